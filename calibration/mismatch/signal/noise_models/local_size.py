"""How large the noise of a course is about each reading, and a course over it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def of_usual_noise(
    left: Array, explained: Array, read: Mask, along: Array, thresholds: Thresholds = THRESHOLDS
) -> tuple[Array, Array]:
    """Return both courses, where they were read (instant,), over the size of the noise, or its usual size if larger.

    Several wheels are added up at each instant, each over its own noise.

    Parameters
    ----------
    left, explained: what is left, and what the named effects explain, shape (time, wheel)
    read: where to look, of the same shape
    along: factor of each reading, of the same shape: the direction, or 1
    """
    total, beside = np.zeros(len(left)), np.zeros(len(left))
    for wheel in range(left.shape[1]):
        here = read[:, wheel]
        course = left[here, wheel] * along[here, wheel]
        size = noise_size(course, thresholds.noise_size_readings)
        total[here] += course / size
        beside[here] += explained[here, wheel] * along[here, wheel] / size
    wheels = read.sum(axis=1)
    some = wheels > 0
    return total[some] / np.sqrt(wheels[some]), beside[some] / np.sqrt(wheels[some])


def noise_size(values: Array, readings: int) -> Array:
    """Return how large the noise is about each reading of a course (time,), and at least as it is usually.

    It is the root mean square of differences from one reading to the next, in which nothing slow has a part: neither
    spells nor slow noise. Where it is smaller than usual, the misfit of a law would be enlarged.
    """
    if len(values) <= readings:
        return np.full(len(values), (float(np.std(values)) if len(values) else 0.0) or 1.0)
    squares = np.concatenate(([0.0], np.cumsum(np.diff(values) ** 2)))
    first = np.clip(np.arange(len(values)) - readings // 2, 0, len(values) - 1 - readings)
    local = (squares[first + readings] - squares[first]) / readings
    usual = float(np.median(local)) or float(np.mean(local)) or 1.0
    return np.asarray(np.sqrt(np.maximum(local, usual)))
