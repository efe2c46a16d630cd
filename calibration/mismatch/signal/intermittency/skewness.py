"""Skewness of running means: what comes and goes, told from symmetric noise of any memory.

Noise is as often above its mean as below. Its size may vary with load or speed, and its single readings may be skewed,
as those of a rectified signal are. Neither is anything that comes and goes: the size is divided out before, and of the
third cumulant of means that part is taken off which independent readings have.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.means import running_mean
from regolithd.calibration.mismatch.signal.noise_models.noise import significant_autocorrelation
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]

FEWEST_TO_SCORE = 8
"""Readings from which on the distribution of their skewness is known (D'Agostino, 1970)."""


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
    score = normal_score(beyond / std**3, 6 / skewness_error(means, thresholds) ** 2)
    return score > thresholds.most_skewness_deviates


def normal_score(skewness: float, readings: float) -> float:
    """Return the standard normal deviate that is as improbable as this skewness of so many normal readings.

    The skewness of few readings is not normally distributed: four of its standard errors are less improbable than four
    deviations are (D'Agostino, 1970).
    """
    n = max(readings, FEWEST_TO_SCORE)
    kurtosis = 3 * (n**2 + 27 * n - 70) * (n + 1) * (n + 3) / ((n - 2) * (n + 5) * (n + 7) * (n + 9))
    square = np.sqrt(2 * (kurtosis - 1)) - 1
    scaled = skewness * np.sqrt((n + 1) * (n + 3) / (6 * (n - 2))) / np.sqrt(2 / (square - 1))
    return float(np.arcsinh(scaled) / np.sqrt(0.5 * np.log(square)))


def third_cumulant(values: Array) -> float:
    """Return the mean cube of a course's deviations."""
    deviations = values - values.mean()
    return float(np.mean(deviations * deviations * deviations))  # `** 3` takes ten times as long


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
