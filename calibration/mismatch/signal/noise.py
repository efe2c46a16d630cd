"""Model of a residual's noise: standard deviation on each wheel and one autocorrelation time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]


LEAST_PAIRS = 0.05
"""Share of pairs from which a lag can end the sum (a choice: at a tenth, a sensor has the lags that it is read at)."""


@dataclass(frozen=True)
class NoiseModel:
    """Stationary noise with a standard deviation of its own on each wheel.

    Attributes
    ----------
    deviation: standard deviation, shape (wheel,)
    autocorrelation_time: sum of the autocorrelation over all lags [readings], at least 1: so many readings carry as
        much information as one independent reading
    """

    deviation: Array
    autocorrelation_time: float

    @property
    def weights(self) -> Array:
        """One over the long-run variance, shape (wheel,): a weighted sum of squares is then −2 log likelihood."""
        return 1 / (self.deviation**2 * self.autocorrelation_time)


def estimate_noise(residual: Array, mask: NDArray[np.bool_], thresholds: Thresholds = THRESHOLDS) -> NoiseModel:
    """Estimate the noise from a residual [time, wheel] that holds as little structure as possible.

    The autocorrelation is pooled over wheels.
    """
    clean = np.where(mask, residual, 0.0)
    deviation = _deviation(clean, mask)
    correlation = significant_autocorrelation(clean / deviation, mask, thresholds)
    return NoiseModel(deviation, float(max(1.0, 1 + 2 * np.sum(correlation))))


def significant_autocorrelation(scaled: Array, mask: NDArray[np.bool_], thresholds: Thresholds = THRESHOLDS) -> Array:
    """Return the autocorrelation at the lags from 1 on that are significant, shape (lag,), pooled over wheels.

    It ends before the lag at which it first falls below its own standard error (Geyer, 1992): further lags would add
    variance to a sum over lags, and no bias. A lag counts by the share of its pairs that were read: of a sensor that
    is read in every tenth row, readings are ten rows apart.

    Parameters
    ----------
    scaled: residual over its standard deviation, shape (time, wheel); 0 where it is masked
    mask: what was read, of the same shape
    """
    lags = int(thresholds.longest_lag_share * len(scaled))
    correlation, share = _autocorrelation(scaled, mask, lags)
    standard_error = thresholds.lag_significance / np.sqrt(max(float(mask.sum()), 1.0))
    insignificant = np.flatnonzero((correlation[1:] < standard_error) & (share[1:] > LEAST_PAIRS))
    end = int(insignificant[0]) + 1 if insignificant.size else lags
    return np.asarray((share * correlation)[1:end])


def _deviation(clean: Array, mask: NDArray[np.bool_]) -> Array:
    """Return each wheel's standard deviation; where a wheel has none, the median of the others."""
    deviation = np.sqrt(np.sum(clean**2, axis=0) / np.maximum(mask.sum(axis=0), 1))
    positive = deviation[deviation > 0]
    return np.where(deviation > 0, deviation, np.median(positive) if positive.size else 1.0)


def _autocorrelation(scaled: Array, mask: NDArray[np.bool_], lags: int) -> tuple[Array, Array]:
    """Return the autocorrelation at lags from 0, pooled over the wheels, and the share of pairs, each of shape (lag,).

    The share is that of the readings which have another one so much later, among those that the recording's end allows.
    """
    size = 2 ** int(np.ceil(np.log2(2 * len(scaled))))

    def summed(values: Array) -> Array:
        spectrum = np.fft.rfft(values, size, axis=0)
        return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[:lags].sum(axis=1))

    pairs = np.rint(summed(mask.astype(np.float64)))
    share = pairs / max(float(pairs[0]), 1.0) * len(scaled) / (len(scaled) - np.arange(len(pairs)))
    return summed(scaled) / np.maximum(pairs, 1), share
