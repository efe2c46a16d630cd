"""A scale on which an input's error has the same standard deviation at each reading.

An error that is relative grows with the reading: of a load cell that is good to 1 %, that of 900 kg is four times that
of 225 kg. What smooths readings believes all of them alike, and would find that neither fits the stated error. On the
scale

    y = s asinh(r x / a) / r,   with dy/dx = s / sqrt(a² + r² x²)

(a, r: absolute and relative error, s: standard deviation on this scale) it has the standard deviation s everywhere
(variance-stabilising transformation; Bartlett, 1947). Without a relative error y is x. What bends the scale within one
error, half the square of the relative error (0.1 % of a reading at 5 %), is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.prior import SensorError

Array = NDArray[np.float64]

LEAST_SHARE = 0.1
"""Absolute error in relative errors of the mean magnitude, at least (a choice): no sensor is exact at 0."""


@dataclass(frozen=True)
class ReadingScale:
    """Error of one column of readings: sqrt(absolute² + (relative · reading)²), in the unit of the readings."""

    absolute: float
    relative: float
    deviation: float

    @classmethod
    def of(cls, readings: Array, error: SensorError) -> ReadingScale:
        """Return that of readings (NaN: blank) of any shape; `deviation` is the error at their mean magnitude."""
        known = np.abs(readings[np.isfinite(readings)])
        mean = float(known.mean()) if known.size else 0.0
        absolute = max(error.absolute, LEAST_SHARE * error.relative * mean)
        relative = error.relative if absolute else 0.0  # where all readings are 0
        return cls(absolute, relative, float(np.hypot(absolute, relative * mean)))

    def error(self, readings: Array) -> Array:
        """Return the standard deviation of each reading's error."""
        return np.hypot(self.absolute, self.relative * readings)

    def stabilised(self, readings: Array) -> Array:
        """Return readings on the scale on which the error is `deviation` everywhere."""
        if not self.relative:
            return readings
        return self.deviation / self.relative * np.arcsinh(self.relative / self.absolute * readings)

    def readings(self, stabilised: Array) -> Array:
        """Return values of that scale in the unit of the readings."""
        if not self.relative:
            return stabilised
        return self.absolute / self.relative * np.sinh(self.relative / self.deviation * stabilised)
