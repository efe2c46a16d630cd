"""Noisy columns' true values as first-order autoregressive normal processes about their means.

The correlation is the recording's own, so that a signal that jumps is hardly smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.true_values import NormalTruth
from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion

Array = NDArray[np.float64]

SETTLED = 1e-15
"""Relative change of a variance from one instant to the next, up to which it is settled: a few roundings."""


@dataclass(frozen=True, eq=False)
class NormalTruths:
    """What a first-order autoregressive normal model says of columns of true values.

    Attributes
    ----------
    mean, variance: given all readings, shape (time, column); the mean is NaN where nothing was read
    model: of the truth and its readings
    """

    mean: Array
    variance: Array
    model: Autoregressions

    def column(self, number: int) -> NormalTruth:
        """Return one column's."""
        own = self.model.column(number)
        return NormalTruth(
            mean=self.mean[:, number],
            variance=self.variance[:, number],
            prior_mean=float(own.mean[0]),
            prior_variance=float(own.variance[0]),
            persistence=float(own.persistence[0]),
            again=lambda readings: own.given(readings[:, None]).mean[:, 0],
        )


@dataclass(frozen=True, eq=False)
class Autoregressions:
    """First-order autoregressive normal truths of columns, each with errors of its readings.

    Attributes
    ----------
    mean, variance, persistence: of the truth, shape (column,)
    error: variance of the readings' errors, shape (column,)
    starts: instants where a run begins anew
    """

    mean: Array
    variance: Array
    persistence: Array
    error: Array
    starts: NDArray[np.int64]

    def column(self, number: int) -> Autoregressions:
        """Return one column's."""
        at = slice(number, number + 1)
        return Autoregressions(self.mean[at], self.variance[at], self.persistence[at], self.error[at], self.starts)

    def given(self, values: Array) -> NormalTruths:
        """Return what readings (time, column) say, by a Kalman filter run forwards and backwards.

        NaN stays NaN; the filter predicts across it.
        """
        known, persistence, starts = np.isfinite(values), self.persistence, self.starts
        centred = np.where(known, values - self.mean, 0.0)
        predicted, spread = _variances(known, persistence, self.variance, self.error, starts)
        gain = np.where(known, predicted / (predicted + self.error + 1e-300), 0.0)
        kept = (1 - gain) * persistence
        kept[starts] = 0.0
        estimate = recursion(kept, gain * centred)
        back, after = np.zeros_like(spread), np.zeros_like(spread)
        back[:-1], after[:-1] = spread[:-1] * persistence / predicted[1:], predicted[1:]
        back[starts[starts > 0] - 1] = 0.0
        smooth = recursion(back[::-1], ((1 - back * persistence) * estimate)[::-1])[::-1]
        # P(t | all) = P(t | t) + back² (P(t + 1 | all) − P(t + 1 | t))
        doubt = recursion(back[::-1] ** 2, (spread - back**2 * after)[::-1])[::-1]
        return NormalTruths(np.where(known, smooth + self.mean, np.nan), doubt, self)


def normal_truths(values: Array, error_variance: Array, starts: NDArray[np.int64]) -> NormalTruths:
    """Smooth columns of noisy readings, shape (time, column), by the autoregressions that they show.

    `error_variance` [per column] is the readings' error; `starts` are the instants where a run begins anew.
    """
    known = np.isfinite(values)
    mean = np.array([np.mean(c[k]) if k.any() else 0.0 for c, k in zip(values.T, known.T, strict=True)])
    persistence, variance = _autoregression(np.where(known, values - mean, 0.0), known, error_variance)
    return Autoregressions(mean, variance, persistence, error_variance, starts).given(values)


def _autoregression(centred: Array, known: NDArray[np.bool_], error_variance: Array) -> tuple[Array, Array]:
    """Return the truth's lag-one correlation and variance.

    Half the mean square of increments is the error plus what the truth moved. The lag is the shortest at which the
    truth moves as much as the error does: there the two can be told apart, and the truth's speed is read off.
    """
    total = np.sum(centred**2, axis=0) / np.maximum(known.sum(axis=0), 1)
    variance = np.maximum(total - error_variance, 1e-3 * total + 1e-300)
    moved = np.full(total.shape, np.nan)
    for lag in 2 ** np.arange(int(np.log2(max(len(centred) // 4, 2)))):
        both = known[lag:] & known[:-lag]
        steps = np.where(both, centred[lag:] - centred[:-lag], 0.0)
        half = 0.5 * np.sum(steps**2, axis=0) / np.maximum(both.sum(axis=0), 1) - error_variance
        # γ(lag) = variance (1 − persistence^lag)
        decay = np.clip(1 - half / variance, 1e-6, 1 - 1e-9) ** (1 / lag)
        moved = np.where(np.isnan(moved) & (half > error_variance), decay, moved)
    return np.where(np.isnan(moved), 1 - 1e-3, moved), variance


def _variances(
    known: NDArray[np.bool_], persistence: Array, variance: Array, error: Array, starts: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return the variance of the filter's estimate before and after each reading, shape (time, column).

    They depend on what is known, not on the readings. Where that does not change they settle, and then stay.
    """
    predicted, spread = np.empty(known.shape), np.empty(known.shape)
    innovation, begins = (1 - persistence**2) * variance, set(starts.tolist())
    changes = np.flatnonzero(np.any(known[1:] != known[:-1], axis=1)) + 1
    cuts = np.unique(np.concatenate(([0], changes, starts, [len(known)])))
    doubt = variance
    for first, last in pairwise(cuts.tolist()):
        before = np.full(variance.shape, np.inf)
        for t in range(first, last):
            doubt = variance if t in begins else doubt
            after = np.where(known[t], (1 - doubt / (doubt + error + 1e-300)) * doubt, doubt)
            predicted[t], spread[t] = doubt, after
            settled = np.all(np.abs(after - before) <= SETTLED * after)
            before, doubt = after, persistence**2 * after + innovation
            if settled:
                predicted[t:last], spread[t:last] = doubt, after
                break
    return predicted, spread
