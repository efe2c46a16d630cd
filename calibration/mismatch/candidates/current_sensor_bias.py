"""Constant offset of one sensor reading, independent of the direction of motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem


class CurrentSensorBias(Candidate):
    """A constant on one wheel's reading."""

    name = "current-sensor-bias"
    covariate = "none"
    equation = "Δy = y_0"
    words = "an offset of the current sensor, whatever the direction"
    signature = "one wheel's residual is constant and keeps its sign when the wheel reverses"
    experiment = "read the sensor at rest and without power, then run to and fro"
    experiment_one_way = "read the sensor at rest and without power, then run at several values of the {wheel_speed}"
    vary: ClassVar = ("direction",)
    needs = "a predicted column in A, mA, µA or kA"
    source = "data sheets of shunt amplifiers: offsets of milliamperes"
    along_motion = False
    coefficients: ClassVar = (Coefficient("offset", "{unit}", 0),)
    sharing: ClassVar = ("one",)
    units = frozenset({"A", "mA", "µA", "kA"})

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002
        """Return a constant 1."""
        return np.ones((1, *problem.mask.shape))
