"""Viscous friction: drag that grows with speed, from grease and a motor's iron losses."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

POWER_PRIOR = (1.0, 0.2)
"""Mean and standard deviation of the power (a choice: 0.7 and 1.4 are one in ten and one in twenty). At the ends of its
range the law is nearly another one."""


class ViscousFriction(Candidate):
    """Drag proportional to a power of speed near 1 (below: shear-thinning grease)."""

    name = "viscous-friction"
    covariate = "wheel_speed"
    equation = "Δy = b sign(ω) |ω|^p"
    words = "drag that grows with speed"
    signature = "a residual along sign(ω) that rises with |ω| and vanishes towards standstill"
    experiment = "hold at least four values of the {wheel_speed}, from the slowest to the highest, both ways"
    experiment_one_way = "hold at least four values of the {wheel_speed}, from the slowest to the highest"
    vary: ClassVar = ("wheel_speed", "direction")
    source = "grease viscosity; power 0.7 (shear-thinning) to 1.4 (churning)"
    requires = ("wheel_speed",)
    loads = True
    coefficients: ClassVar = (Coefficient("viscous_coefficient", "{unit} ({per_speed})^p"),)
    shape_keys: ClassVar = {"power": "p"}
    free: ClassVar = {"power": (0.7, 1.4)}
    shape_priors: ClassVar = {"power": POWER_PRIOR}

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """Return the law proportional to speed, then a shear-thinning and a churning one."""
        return [{"power": 1.0}, {"power": 0.75}, {"power": 1.35}]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sign(ω)|ω|^p."""
        speed = problem.covariates["wheel_speed"]
        return (np.sign(speed) * np.abs(speed) ** float(shape["power"]))[None]
