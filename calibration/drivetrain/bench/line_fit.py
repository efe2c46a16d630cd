"""Least-squares line through the step means of a bench procedure, with standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BenchError(ValueError):
    """A recording does not contain what the procedure needs; the message says what to do at the bench."""


@dataclass(frozen=True, slots=True)
class LineFit:
    """y = offset + slope x, each with its standard deviation; `residual_std` is that of y about the line."""

    offset: float
    offset_std: float
    slope: float
    slope_std: float
    residual_std: float


def fit_line(x: Array, y: Array, steps: Array) -> LineFit:
    """Return the least-squares line through the means of the steps.

    Samples of one step have a common error (a weight put on off-centre, a grease film), so the number of steps, not of
    samples, determines the standard deviations: a thousand samples of two weights are two measurements.

    Parameters
    ----------
    x, y
        Measurements, shape (samples,).
    steps
        Number of the step that each sample belongs to, same shape.

    Raises
    ------
    BenchError
        There are fewer than three steps, or all are at the same x.
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
    return LineFit(offset, offset_std, slope, slope_std, deviation)
