"""A straight line through measurements, with honest errors: what three of the four procedures come down to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BenchError(ValueError):
    """A recording does not hold what the procedure needs; the message says what to do at the bench."""


@dataclass(frozen=True, slots=True)
class Line:
    """y = offset + slope x, each with its standard deviation; `residual_std` is that of y about the line."""

    offset: float
    offset_std: float
    slope: float
    slope_std: float
    residual_std: float


def fit_line(x: Array, y: Array, steps: Array) -> Line:
    """Return the least-squares line through the means of each step of the procedure.

    Samples within a step share its errors (a weight put on askew, a grease film), so that the steps and not the samples
    are what the uncertainty counts: a thousand samples of two weights are two measurements.
    """
    names = np.unique(steps)
    if len(names) < 3:
        raise BenchError(f"{len(names)} steps were found; a line with an uncertainty needs at least three")
    at = np.array([x[steps == name].mean() for name in names])
    level = np.array([y[steps == name].mean() for name in names])
    if np.ptp(at) == 0:
        raise BenchError("all steps are at the same value: a line needs different ones")
    middle = at.mean()
    spread = np.sum((at - middle) ** 2)
    slope = float(np.sum((at - middle) * (level - level.mean())) / spread)
    offset = float(level.mean() - slope * middle)
    residual = level - offset - slope * at
    deviation = float(np.sqrt(np.sum(residual**2) / (len(at) - 2)))
    slope_std = deviation / float(np.sqrt(spread))
    offset_std = deviation * float(np.sqrt(1 / len(at) + middle**2 / spread))
    return Line(offset, offset_std, slope, slope_std, deviation)
