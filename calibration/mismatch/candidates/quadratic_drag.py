"""Drag that grows with the square of speed: air, water, a fan or a propeller on the shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem


class QuadraticDrag(Candidate):
    """Form drag of a body in a fluid, against the motion."""

    name = "quadratic-drag"
    covariate = "wheel_speed"
    equation = "Δy = d sign(ω) ω²"
    words = "drag that grows with the square of speed"
    signature = "a residual along sign(ω) that rises with ω² and is flat near standstill"
    experiment = "hold at least four values of the {wheel_speed}, from the slowest to the highest, both ways"
    experiment_one_way = "hold at least four values of the {wheel_speed}, from the slowest to the highest"
    vary: ClassVar = ("wheel_speed", "direction")
    source = "Newton's drag law F = ½ ρ c A v²; centrifugal fans and pumps have torque proportional to speed squared"
    requires = ("wheel_speed",)
    loads = True
    coefficients: ClassVar = (Coefficient("quadratic_coefficient", "{unit} {per_speed2}"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002
        """Return sign(ω) ω²."""
        speed = problem.covariates["wheel_speed"]
        return (speed * np.abs(speed))[None]
