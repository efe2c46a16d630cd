"""Skewness of running means: what comes and goes, told from symmetric noise of any memory.

Noise is as often above its mean as below. Its size may vary with load or speed, and its single readings may be skewed,
as those of a rectified signal are. Neither is anything that comes and goes: the size is divided out, and of the third
cumulant of means that part is taken off which independent readings have.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.noise import significant_autocorrelation
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def skewed_lengths(left: Array, explained: Array, thresholds: Thresholds = THRESHOLDS) -> tuple[int, ...]:
    """Return the lengths [readings] at which running means of what is left (time,) are skewed by more than chance.

    Means that are small against those of what the named effects explain are the misfit of laws, of any distribution.
    """
    if len(left) < thresholds.fewest_means:
        return ()
    of_one, found, length = third_cumulant(left), [], 1
    while thresholds.fewest_means * length <= len(left):
        means, beside = running_mean(left, length), running_mean(explained, length)
        large = np.sum(means**2) > thresholds.form_misfit * np.sum(beside**2)
        if large and _is_skewed(means, of_one / length**2, thresholds):
            found.append(length)
        length *= 2
    return tuple(found)


def _is_skewed(means: Array, of_independent: float, thresholds: Thresholds) -> bool:
    """Return whether means are skewed by more than chance, and by more than those of independent readings are."""
    third, std = third_cumulant(means), float(np.std(means))
    # Faults that recur regularly have less of it in means than independent readings have: that is no spell.
    beyond = abs(float(np.median((0.0, third, third - of_independent))))
    if not beyond > thresholds.least_skewness * std**3 > 0:
        return False
    return beyond > thresholds.most_skewness_errors * skewness_error(means, thresholds) * std**3


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


def running_mean(values: Array, length: int) -> Array:
    """Return the means of so many readings that follow each other, each set of them."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray((total[length:] - total[:-length]) / length)


def third_cumulant(values: Array) -> float:
    """Return the mean cube of a course's deviations."""
    away = values - values.mean()
    return float(np.mean(away * away * away))  # a power of an array takes ten times as long


def skewness_error(values: Array, thresholds: Thresholds = THRESHOLDS) -> float:
    """Return the standard error of the skewness of a course (time,), were it normal with its own autocorrelation.

    The variance is 6/n (1 + 2 Σ ρ³) (Lomnicki, 1961); the sum is over the lags that are significant.
    """
    deviations = values - values.mean() if len(values) else values
    std = float(np.std(deviations)) if len(values) else 0.0
    if std == 0.0:
        return float("inf")
    scaled = (deviations / std)[:, None]
    correlation = significant_autocorrelation(scaled, np.ones(scaled.shape, bool), thresholds)
    return float(np.sqrt(6 / len(values) * (1 + 2 * float(np.sum(correlation**3)))))
