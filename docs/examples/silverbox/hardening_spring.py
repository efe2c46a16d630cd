"""A spring that becomes stiffer as it is stretched (Duffing)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch import Array, Problem


class HardeningSpring(Candidate):
    """A restoring force that grows with the cube of the position."""

    name = "hardening-spring"
    covariate = "position"
    equation = "F = k_3 y^3"
    words = "a spring that hardens: a force with the cube of the position"
    signature = "a residual that is a cubic over the position, the same at all speeds"
    experiment = "excite it with at least two amplitudes, the larger twice the smaller"
    source = "Duffing (1918)"
    requires = ("position",)
    along_motion = False
    coefficients: ClassVar = (Coefficient("cubic_stiffness", "{unit}/V³", 0),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return y³."""
        return np.asarray(problem.covariates["position"])[None] ** 3
