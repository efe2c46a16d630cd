"""Errors in variables: noisy inputs replaced by their conditional expectation (regression calibration).

The error of an input biases the prediction and every candidate that is computed from the same reading, in the same
way: the residual correlates with candidates though no physics is missing. Replacing a reading by E[truth | recording]
removes this; the error that remains is of Berkson's kind, uncorrelated with what is computed from it (Carroll et al.,
2006, chapter 4). The truth is modelled as first-order autoregressive about its mean, with the correlation of the
recording, so that a signal that jumps is hardly smoothed; where it moves smoothly, and its readings show that a
smoothing spline is clearly nearer to it, by that. With a stated error of 0 nothing changes. Where the error is relative
to the reading, all this is on a scale on which it is not (`reading_scale.py`).

A normal density is wrong for a truth that is 0 for half of the time, or has few levels, and shrinks it wrongly. So the
density of the truth's values is estimated too, and used in two more models: in the place of the autoregression's normal
density, and for a truth that keeps its value for a while and then takes another. The readings tell how far each is from
the truth, and how to combine them (`signal/stein.py`); where that is no clear gain, the normal model stays alone. It
also does for what the speed is computed from: a speed is differentiated, and its sign is the direction of friction.

A sensor with noise does not read exactly 0 twice, nor as a run begins or ends: where it does, it is at rest or within
its dead band, and stays 0. A simulation may have a step there, as friction has.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.true_values import (
    NoisyColumn,
    NormalTruth,
    filtered_where_better,
    refined_by_density,
    smooth_where_better,
    still_at_rest,
    with_direction_of_motion,
)
from regolithd.calibration.mismatch.signal.recursion import recursion

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.prior import SensorError

Array = NDArray[np.float64]

SETTLED = 1e-15
"""Relative change of a variance from one instant to the next, up to which it is settled: a few roundings."""


@dataclass(frozen=True, eq=False)
class NormalTruths:
    """What a first-order autoregressive normal model says of columns of true values.

    Attributes
    ----------
    mean, variance: given all readings, shape (time, column); the mean is NaN where nothing was read
    prior_mean, prior_variance, persistence: of the model, shape (column,)
    """

    mean: Array
    variance: Array
    prior_mean: Array
    prior_variance: Array
    persistence: Array

    def column(self, number: int) -> NormalTruth:
        """Return one column's."""
        prior = (self.prior_mean, self.prior_variance, self.persistence)
        return NormalTruth(self.mean[:, number], self.variance[:, number], *(float(each[number]) for each in prior))


def expected_inputs(
    recording: Recording, sensors: Mapping[str, SensorError], normal: Collection[str] = ()
) -> Recording:
    """Return the recording with each input that has an error replaced by its conditional expectation.

    `normal` names inputs of which no density of values is estimated.
    """
    names = [
        name for name, error in sensors.items() if name in recording.channels and (error.relative or error.absolute)
    ]
    if not names:
        return recording
    values = np.concatenate([recording.channels[name] for name in names], axis=1)
    owners = [name for name in names for _ in recording.wheels]
    scales = [ReadingScale.of(column, sensors[name]) for name, column in zip(owners, values.T, strict=True)]
    starts = run_starts(recording)
    stabilised = np.stack([scale.stabilised(column) for scale, column in zip(scales, values.T, strict=True)], axis=1)
    rest = at_rest(values, starts)
    truths = normal_truths(stabilised, np.array([scale.deviation for scale in scales]) ** 2, starts)
    smooth = truths.mean.copy()
    for k, name in enumerate(owners):
        if k and owners[k - 1] == name and np.array_equal(values[:, k - 1], values[:, k], equal_nan=True):
            smooth[:, k] = smooth[:, k - 1]  # a sensor of the whole machine
            continue
        moving, deviation = np.where(rest[:, k], np.nan, stabilised[:, k]), scales[k].deviation
        before = truths.column(k)
        noisy = NoisyColumn(stabilised[:, k], deviation, recording.time_s, recording.run, rest[:, k])
        truth = filtered_where_better(noisy, smooth_where_better(noisy, before))
        if name not in normal:
            smooth[:, k] = refined_by_density(moving, deviation, starts, truth)
        elif truth is not before:
            # A sensor that reads exactly 0 at rest reads anything else in motion.
            smooth[:, k] = truth.mean if rest[:, k].any() else still_at_rest(moving, deviation, truth).mean
        if rest[:, k].any():
            smooth[:, k] = with_direction_of_motion(smooth[:, k], deviation, rest[:, k])
    expected = np.stack([scale.readings(column) for scale, column in zip(scales, smooth.T, strict=True)], axis=1)
    parts = np.split(np.where(rest, 0.0, expected), len(names), axis=1)
    return recording.with_channels(**dict(zip(names, parts, strict=True)))


def run_starts(recording: Recording) -> NDArray[np.int64]:
    """Return the instants with which a run begins."""
    return np.array([rows.start for rows in recording.runs], np.int64)


def at_rest(values: Array, starts: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return where a reading, shape (time, column), is exactly 0, and one beside it is, or it begins or ends a run.

    `starts` are the instants where a run begins. Before and after a run a machine usually rests.
    """
    zero = values == 0
    before, after = np.ones_like(zero), np.ones_like(zero)
    before[1:], after[:-1] = zero[:-1], zero[1:]
    later = starts[starts > 0]
    before[later], after[later - 1] = True, True
    return zero & (before | after)


def known_mean(values: Array, axis: int = 0) -> Array:
    """Return the mean over the finite values along an axis; 0 where there are none."""
    known = np.isfinite(values)
    return np.asarray(np.sum(np.where(known, values, 0.0), axis=axis) / np.maximum(known.sum(axis=axis), 1))


def conditional_expectation(values: Array, error_variance: Array, starts: NDArray[np.int64]) -> Array:
    """Return the mean of `normal_truths`: columns of noisy readings, shape (time, column), smoothed."""
    return normal_truths(values, error_variance, starts).mean


def normal_truths(values: Array, error_variance: Array, starts: NDArray[np.int64]) -> NormalTruths:
    """Smooth columns of noisy readings, shape (time, column), by a Kalman filter run forwards and backwards.

    `error_variance` [per column] is the readings' error; `starts` are the instants where a run begins anew.
    NaN stays NaN; the filter predicts across it.
    """
    known = np.isfinite(values)
    mean = np.array([np.mean(c[k]) if k.any() else 0.0 for c, k in zip(values.T, known.T, strict=True)])
    centred = np.where(known, values - mean, 0.0)
    persistence, variance = _autoregression(centred, known, error_variance)
    predicted, spread = _variances(known, persistence, variance, error_variance, starts)
    gain = np.where(known, predicted / (predicted + error_variance + 1e-300), 0.0)
    kept = (1 - gain) * persistence
    kept[starts] = 0.0
    estimate = recursion(kept, gain * centred)
    back, after = np.zeros_like(spread), np.zeros_like(spread)
    back[:-1], after[:-1] = spread[:-1] * persistence / predicted[1:], predicted[1:]
    back[starts[starts > 0] - 1] = 0.0
    smooth = recursion(back[::-1], ((1 - back * persistence) * estimate)[::-1])[::-1]
    # P(t | all) = P(t | t) + back² (P(t + 1 | all) − P(t + 1 | t))
    doubt = recursion(back[::-1] ** 2, (spread - back**2 * after)[::-1])[::-1]
    return NormalTruths(np.where(known, smooth + mean, np.nan), doubt, mean, variance, persistence)


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
