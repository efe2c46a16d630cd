"""Model of a residual's noise: standard deviation and autocorrelation time on each wheel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_PAIRS = 0.05
"""Share of pairs from which a lag can end the sum (a choice: at a tenth, a sensor has the lags that it is read at)."""
LEAST_MOVING = 0.1
"""Share of a wheel's readings in motion from which on their noise is told from that of all (a choice)."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Stationary noise with a standard deviation and an autocorrelation time of its own on each wheel.

    Attributes
    ----------
    deviation: standard deviation, shape (wheel,)
    autocorrelation_times: sum of the autocorrelation over all lags [readings], at least 1: so many readings carry as
        much information as one independent reading; of each wheel, shape (wheel,), or of all
    """

    deviation: Array
    autocorrelation_times: Array | float

    @property
    def autocorrelation_time(self) -> float:
        """Mean over the wheels [readings]."""
        return float(np.mean(self.autocorrelation_times))

    @property
    def weights(self) -> Array:
        """One over the long-run variance, shape (wheel,): a weighted sum of squares is then −2 log likelihood."""
        return 1 / (self.deviation**2 * self.autocorrelation_times)


def estimate_noise(
    residual: Array, mask: Mask, thresholds: Thresholds = THRESHOLDS, moving: Mask | None = None
) -> NoiseModel:
    """Estimate the noise from a residual [time, wheel] that holds as little structure as possible.

    `moving` is where a wheel moves: a machine that is quieter at rest must not be believed more in motion for it.
    """
    clean = np.where(mask, residual, 0.0)
    deviation = _deviation(clean, mask)
    if moving is not None:
        enough = (mask & moving).sum(axis=0) > LEAST_MOVING * mask.sum(axis=0)
        in_motion = _deviation(np.where(moving, clean, 0.0), mask & moving)
        deviation = np.where(enough, np.maximum(deviation, in_motion), deviation)
    return NoiseModel(deviation, _autocorrelation_times(clean / deviation, mask, thresholds))


def _autocorrelation_times(scaled: Array, mask: Mask, thresholds: Thresholds) -> Array:
    """Return each wheel's autocorrelation time, shape (wheel,).

    The times of the wheels differ from the one that is pooled over them by as much as they scatter beyond chance (James
    and Stein, 1961), and upwards alone: no wheel is believed more than all of them are. The relative variance of a sum
    over M lags is 2 (2 M + 1) / n (Madras and Sokal, 1988).
    """
    lags = int(thresholds.longest_lag_share * len(scaled))
    squares, pairs = _sums_over_lags(scaled, lags), _pairs(mask, lags)
    together = _significant(squares.sum(axis=1), pairs.sum(axis=1), len(scaled), thresholds)
    pooled = max(1.0, 1 + 2 * float(np.sum(together)))
    read = np.flatnonzero(pairs[0] > 0)
    times, error = np.full(scaled.shape[1], pooled), np.zeros(scaled.shape[1])
    for wheel in read if len(read) > 1 else ():
        of_wheel = squares[:, wheel], pairs[:, wheel], len(scaled)
        last = max(len(together), len(_significant(*of_wheel, thresholds)))
        times[wheel] = max(1.0, 1 + 2 * float(np.sum(_counted(*of_wheel)[1 : last + 1])))
        error[wheel] = 2 * (2 * last + 1) / float(pairs[0, wheel])
    scatter = float(np.var(np.log(times[read]), ddof=1)) if len(read) > 1 else 0.0
    beyond_chance = max(1 - float(np.mean(error[read])) / scatter, 0.0) if scatter > 0 else 0.0
    return pooled * np.maximum(times / pooled, 1.0) ** beyond_chance


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
    squares, pairs = _sums_over_lags(scaled, lags), _pairs(mask, lags)
    return _significant(squares.sum(axis=1), pairs.sum(axis=1), len(scaled), thresholds)


def _significant(squares: Array, pairs: Array, instants: int, thresholds: Thresholds) -> Array:
    """Return the autocorrelation from lag 1 to before the first insignificant one, from sums over each lag's pairs."""
    correlation, share = _correlation(squares, pairs), _share(pairs, instants)
    standard_error = thresholds.lag_significance / np.sqrt(max(float(pairs[0]), 1.0))
    insignificant = np.flatnonzero((correlation[1:] < standard_error) & (share[1:] > LEAST_PAIRS))
    end = int(insignificant[0]) + 1 if insignificant.size else len(pairs)
    return _counted(squares, pairs, instants)[1:end]


def _counted(squares: Array, pairs: Array, instants: int) -> Array:
    """Return the autocorrelation at each lag times the share of its pairs that were read, shape (lag,)."""
    return np.asarray(_share(pairs, instants) * _correlation(squares, pairs))


def _correlation(squares: Array, pairs: Array) -> Array:
    correlation = squares / np.maximum(pairs, 1)
    return correlation / (correlation[0] or 1.0)


def _share(pairs: Array, instants: int) -> Array:
    """Return the share of the readings that have another one so much later, of those that the end allows."""
    return pairs / max(float(pairs[0]), 1.0) * instants / (instants - np.arange(len(pairs)))


def _deviation(clean: Array, mask: NDArray[np.bool_]) -> Array:
    """Return each wheel's standard deviation; where a wheel has none, the median of the others."""
    deviation = np.sqrt(np.sum(clean**2, axis=0) / np.maximum(mask.sum(axis=0), 1))
    positive = deviation[deviation > 0]
    return np.where(deviation > 0, deviation, np.median(positive) if positive.size else 1.0)


def _sums_over_lags(values: Array, lags: int) -> Array:
    """Return the sums of products of values (time, wheel) that are so many instants apart, shape (lag, wheel)."""
    size = 2 ** int(np.ceil(np.log2(len(values) + lags)))
    spectrum = np.fft.rfft(values, size, axis=0)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[:lags])


def _pairs(mask: Mask, lags: int) -> Array:
    """Return how many pairs of readings are so many instants apart, shape (lag, wheel)."""
    return _pairs_of(mask.tobytes(), len(mask), lags)


@lru_cache(maxsize=4)
def _pairs_of(mask: bytes, instants: int, lags: int) -> Array:
    """Return the same of a mask's bytes: one recording asks for them again and again."""
    read = np.frombuffer(mask, np.bool_).reshape(instants, -1)
    pairs = np.rint(_sums_over_lags(read.astype(np.float64), lags))
    pairs.setflags(write=False)
    return pairs
