"""Friction that is not the same in both directions: a ball screw's preload, a cable, a slope of the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch import Array, Problem


class AsymmetricFriction(Candidate):
    """A constant force besides friction: it adds to friction forwards and reduces it backwards."""

    name = "asymmetric-friction"
    covariate = "direction"
    equation = "F = F_c sign(v) + F_0"
    words = "friction that differs between the two directions"
    signature = "a residual of the same sign in both directions"
    experiment = "move at one speed both ways, then turn the axis end for end and repeat"
    source = "Janot, Gautier and Brunot (2019): a few newtons on this axis"
    requires = ("direction",)
    along_motion = False
    coefficients: ClassVar = (Coefficient("half_difference", "{unit}", 0),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return 1 while the axis moves."""
        return np.abs(np.asarray(problem.covariates["direction"]))[None]
