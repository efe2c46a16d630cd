"""Constant drag against the motion: a motor's no-load current, dry friction of seals and gears."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS, along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


class CoulombFriction(Candidate):
    """A constant that changes sign with the direction of motion (Coulomb, 1785)."""

    name = "coulomb-friction"
    covariate = "direction"
    equation = "Δy = y_c sign(ω)"
    words = "constant drag against the motion (Coulomb friction, no-load current)"
    signature = "a residual of constant size that changes sign with the direction of rotation"
    experiment = "run to and fro at one and the same {wheel_speed}"
    experiment_one_way = "hold at least four values of the {wheel_speed}, from the slowest to the highest"
    source = "Maxon RE 25: no-load current about 37 mA; harmonic drives add their starting torque"
    requires = ("direction",)
    loads = True
    label = "Coulomb friction"
    parameter_labels: ClassVar = {"coulomb_current": "Coulomb friction"}
    coefficients: ClassVar = (Coefficient("coulomb_current", "{unit}"),)
    shape_keys: ClassVar = REVERSAL_KEYS

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return the one shape: a step at standstill, or as friction reverses in the recording."""
        return [reversal_of(problem)]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sign(ω)."""
        return along_motion(problem, shape)[None]
