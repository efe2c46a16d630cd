"""Model of a residual's noise: standard deviation and autocorrelation time on each wheel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    return NoiseModel(
        deviation, autocorrelation_times(_sums_of_wheels(clean / deviation, mask, thresholds), thresholds)
    )


@dataclass(frozen=True, eq=False)
class LaggedSums:
    """Sums over pairs of readings that are so many instants apart, of a residual over its standard deviation.

    Attributes
    ----------
    products: of such readings, shape (lag,)
    pairs: how many there are, shape (lag,)
    allowed: how many there would be if the readings that there are were evenly spread, shape (lag,)
    """

    products: Array
    pairs: Array
    allowed: Array

    @classmethod
    def of(cls, products: Array, pairs: Array, instants: int) -> LaggedSums:
        """Return those of a recording of so many instants, of one wheel or over several."""
        return cls(products, pairs, pairs[0] * (instants - np.arange(len(pairs))) / instants)

    @property
    def count(self) -> float:
        """Number of readings."""
        return float(self.pairs[0])

    def counted(self, last: int) -> Array:
        """Return the autocorrelation at the lags from 1 to `last`, times the share of its pairs that were read.

        Of a sensor that is read in every tenth row, readings are ten rows apart.
        """
        return np.asarray((self._share * self._correlation)[1 : last + 1])

    def significant(self, thresholds: Thresholds) -> Array:
        """Return the same to before the lag at which it first falls below its own standard error (Geyer, 1992).

        Further lags would add variance to a sum over lags, and no bias.
        """
        standard_error = thresholds.lag_significance / np.sqrt(max(self.count, 1.0))
        seen = self._share[1:] > LEAST_PAIRS
        insignificant = np.flatnonzero((self._correlation[1:] < standard_error) & seen)
        return self.counted(int(insignificant[0]) if insignificant.size else len(self.pairs) - 1)

    @property
    def _correlation(self) -> Array:
        correlation = self.products / np.maximum(self.pairs, 1)
        return np.asarray(correlation / (correlation[0] or 1.0))

    @property
    def _share(self) -> Array:
        return np.asarray(self.pairs / np.maximum(self.allowed, 1e-300))


def lagged_sums(residual: Array, mask: Mask, noise: NoiseModel, thresholds: Thresholds = THRESHOLDS) -> LaggedSums:
    """Return the sums over all wheels of a residual [time, wheel] that is noise of a model's standard deviations."""
    return _together(_sums_of_wheels(np.where(mask, residual, 0.0) / noise.deviation, mask, thresholds))


def autocorrelation_times(each: Sequence[LaggedSums], thresholds: Thresholds = THRESHOLDS) -> Array:
    """Return the autocorrelation times of several residuals of one kind, of wheels or of recordings, shape (residual,).

    They differ from the one that is pooled over them by as much as they scatter beyond chance (James and Stein, 1961),
    and upwards alone: none is believed more than all of them are. The relative variance of a sum over M lags is
    2 (2 M + 1) / n (Madras and Sokal, 1988).
    """
    together = _together(each).significant(thresholds)
    pooled = max(1.0, 1 + 2 * float(np.sum(together)))
    read = [place for place, sums in enumerate(each) if sums.count > 0]
    times, error = np.full(len(each), pooled), np.zeros(len(each))
    for place in read if len(read) > 1 else ():
        last = max(len(together), len(each[place].significant(thresholds)))
        times[place] = max(1.0, 1 + 2 * float(np.sum(each[place].counted(last))))
        error[place] = 2 * (2 * last + 1) / each[place].count
    scatter = float(np.var(np.log(times[read]), ddof=1)) if len(read) > 1 else 0.0
    beyond_chance = max(1 - float(np.mean(error[read])) / scatter, 0.0) if scatter > 0 else 0.0
    return np.asarray(pooled * np.maximum(times / pooled, 1.0) ** beyond_chance)


def significant_autocorrelation(scaled: Array, mask: NDArray[np.bool_], thresholds: Thresholds = THRESHOLDS) -> Array:
    """Return the autocorrelation at the lags from 1 on that are significant, shape (lag,), pooled over wheels.

    Parameters
    ----------
    scaled: residual over its standard deviation, shape (time, wheel); 0 where it is masked
    mask: what was read, of the same shape
    """
    return _together(_sums_of_wheels(scaled, mask, thresholds)).significant(thresholds)


def _sums_of_wheels(scaled: Array, mask: Mask, thresholds: Thresholds) -> list[LaggedSums]:
    """Return the sums of each wheel of a residual over its standard deviation [time, wheel]."""
    lags = int(thresholds.longest_lag_share * len(scaled))
    products, pairs = _sums_over_lags(scaled, lags), _pairs(mask, lags)
    return [LaggedSums.of(*of_wheel, len(scaled)) for of_wheel in zip(products.T, pairs.T, strict=True)]


def _together(each: Sequence[LaggedSums]) -> LaggedSums:
    """Return the sums of several residuals; the longest has the most lags."""
    lags = max(len(sums.pairs) for sums in each)

    def total(name: str) -> Array:
        found: Array = np.zeros(lags)
        for sums in each:
            values = getattr(sums, name)
            found[: len(values)] += values
        return found

    return LaggedSums(total("products"), total("pairs"), total("allowed"))


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
