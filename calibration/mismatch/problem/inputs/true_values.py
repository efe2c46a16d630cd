"""One noisy input's true values: by a smoothing spline, a process of any spectrum, and the density of its values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches
from regolithd.calibration.mismatch.signal.truths.jump_chain import JumpChain, Windows, windows_of
from regolithd.calibration.mismatch.signal.truths.mixing_density import MixingDensity, mixing_density
from regolithd.calibration.mismatch.signal.truths.smoothing_spline import best_spline, differences, fitted_rows
from regolithd.calibration.mismatch.signal.truths.stein import (
    FEWEST_READINGS,
    Estimate,
    best_combination,
    clearly_better,
    consistent,
    consistent_throughout,
)
from regolithd.calibration.mismatch.signal.truths.wiener_filter import best_filter, even_pieces

Array = NDArray[np.float64]
Smoother = Callable[[Array], Array]
"""From readings (time,) to the estimate of the truth, by a model that stays as it is."""

MOST_FITTED = 16
"""Windows (of 256 instants each) in which the models are fitted and compared: longer recordings cost no more."""
LEAST_VARIANCE = 1e-4
"""The truth's variance in error variances, below which it is a constant: there is nothing to be told of its density."""
LEAST_ERROR = 0.001
"""Error in standard deviations of the truth below which no density is asked for (a choice). An error of a twentieth
biases a coefficient by a quarter of a percent, but where a column rests at a level for most of the time, its readings
there are nothing but error, and all that is left of a residual follows them."""
LEAST_FILTER_GAIN = 0.05
"""Share of the mean square error that a filter has to gain (a choice: beside a small noise of the predicted channel, a
twentieth of what is left of an input's error stands out over what the prediction was a few readings before)."""
LEAST_LEFT = 0.01
"""Share of the error's variance that smoothing leaves at least (a choice: a mean of a hundred readings has no less)."""
REST_DEVIATIONS = 3.0
"""Posterior standard deviations within which a smoothed value may be 0, and of a mean about it (1 in 370 is beyond)."""
SLOWEST_CREEP = 0.25
"""Mean in standard deviations of the readings' error below which nothing moves (a choice): a sensor's zero is no
better than a part of its error."""
LEAST_IN_MOTION = 0.1
"""Standard deviations of the readings' error that a column has at least in the direction of its motion, between a rest
and the first clear reading (a choice: of a sign, not of a size)."""
FEWEST_AT_REST = 9
"""Readings one after the other that must be so (a choice): fewer are passed on the way from one sign to the other."""
LEAST_POSTERIOR = 1e-6
"""A posterior's variance in error variances is at least this, that of a million readings: less is rounding."""


@dataclass(frozen=True, eq=False)
class NormalTruth:
    """What a first-order autoregressive normal model says of one column's true values.

    Attributes
    ----------
    mean, variance: given all readings, shape (time,)
    prior_mean, prior_variance, persistence: of the model
    again: the mean given other readings
    """

    mean: Array
    variance: Array
    prior_mean: float
    prior_variance: float
    persistence: float
    again: Smoother = field(repr=False)


@dataclass(frozen=True, eq=False)
class NoisyColumn:
    """Readings of one column on a scale on which their errors are normal and alike.

    Attributes
    ----------
    readings: shape (time,), NaN where there are none
    deviation: of their errors
    time, run: of the recording, shape (time,)
    rest: those that have no error, and say where a motion begins and ends
    """

    readings: Array
    deviation: float
    time: Array
    run: NDArray[np.int64]
    rest: NDArray[np.bool_]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Return where there is a reading with an error."""
        return np.isfinite(self.readings) & ~self.rest

    @cached_property
    def fitted(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows in which models are found, and numbers of their unbroken stretches (`fitted_rows`)."""
        return fitted_rows(self.readings, self.run)


def smooth_where_better(column: NoisyColumn, normal: NormalTruth) -> NormalTruth:
    """Return what a smoothing spline says of the truth where that is clearly nearer to it; else `normal`."""
    known, deviation = column.known, column.deviation
    if not _matters(deviation, known, normal):
        return normal
    centred = column.readings - normal.prior_mean
    rows, runs = column.fitted
    if not _matters(deviation, known[rows], normal):  # it was read elsewhere
        return normal
    spline = best_spline(centred[rows], deviation, column.time[rows], runs, column.rest[rows])
    there = spline.estimate(centred[rows], deviation, differences(column.time[rows], runs, spline.order))
    new = _at(there, known[rows])
    old = _at(Estimate((normal.mean - normal.prior_mean)[rows], normal.variance[rows]), known[rows])
    read = centred[rows][known[rows]]
    if not (clearly_better(read, deviation**2, new, old, 2) and consistent(read, deviation**2, new)):
        return normal
    everywhere = differences(column.time, column.run, spline.order)

    def again(readings: Array) -> Array:
        return spline.mean(readings - normal.prior_mean, deviation, everywhere) + normal.prior_mean

    smooth = again(column.readings)
    if not consistent_throughout(column.readings[known], deviation**2, smooth[known]):
        return normal
    variance = max(float(new.variance.mean()), LEAST_LEFT * deviation**2)
    mean = np.where(np.isfinite(normal.mean), smooth, np.nan)
    return replace(normal, mean=mean, variance=np.full(smooth.shape, variance), again=again)


def filtered_where_better(column: NoisyColumn, before: NormalTruth) -> NormalTruth:
    """Return what a stationary process of any spectrum says of the truth where that is clearly nearer to it.

    Else what was said of it `before`. What is left of the error is then correlated with no reading of a window, so that
    nothing seems to follow the prediction or what it was shortly before; a small gain is enough.
    """
    known, variance = column.known, column.deviation**2
    if not _matters(column.deviation, known, before):
        return before
    centred = column.readings - before.prior_mean
    rows, runs = column.fitted
    pieces = even_pieces(centred[rows], column.time[rows], runs)
    found = best_filter(centred[rows], variance, pieces, column.rest[rows])
    if found is None:
        return before
    there = found.applied(centred[rows], pieces, variance)
    told = known[rows] & np.isfinite(there.mean)
    if told.sum() < FEWEST_READINGS:
        return before
    new = _at(there, told)
    old = _at(Estimate((before.mean - before.prior_mean)[rows], before.variance[rows]), told)
    read = centred[rows][told]
    if not (
        clearly_better(read, variance, new, old, found.fitted, LEAST_FILTER_GAIN) and consistent(read, variance, new)
    ):
        return before
    everywhere = found.applied(centred, even_pieces(centred, column.time, column.run), variance)
    told = np.isfinite(everywhere.mean) & np.isfinite(before.mean)
    mean = np.where(told, everywhere.mean + before.prior_mean, before.mean)
    if not consistent_throughout(column.readings[known], variance, mean[known]):
        return before
    left = np.maximum(everywhere.variance, LEAST_LEFT * variance)

    def again(readings: Array) -> Array:
        pieces = even_pieces(readings, column.time, column.run)
        filtered = found.applied(readings - before.prior_mean, pieces, variance).mean + before.prior_mean
        return np.where(np.isfinite(filtered), filtered, before.again(readings))

    return replace(before, mean=mean, variance=np.where(told, left, before.variance), again=again)


def still_at_rest(readings: Array, deviation: float, smooth: NormalTruth) -> NormalTruth:
    """Return the same with 0 wherever a column stays at it.

    What is left of the noise at standstill after smoothing wanders slowly about 0. A simulation that takes its sign
    for a direction would let friction reverse there.
    """
    near = np.abs(np.nan_to_num(smooth.mean, nan=np.inf)) <= REST_DEVIATIONS * np.sqrt(smooth.variance)
    mean = smooth.mean.copy()
    for first, last in stretches(near):
        read = readings[first:last]
        read = read[np.isfinite(read)]
        if len(read) < FEWEST_AT_REST:
            continue
        if abs(read.mean()) <= deviation * max(REST_DEVIATIONS / np.sqrt(len(read)), SLOWEST_CREEP):
            mean[first:last] = 0.0
    return replace(smooth, mean=mean)


def direction_beside_rest(mean: Array, deviation: float, rest: NDArray[np.bool_], longest: int | None = None) -> Array:
    """Return the sign of a motion from a rest to its first clear estimate, and from the last to a rest; 0 elsewhere.

    A motion that begins or ends where readings are exactly 0 has one direction there, whatever the noise of its first
    and last readings: friction of the other one would be as large as that of the whole motion. `longest` is how many
    readings from a clear one on have its direction at most; None: all.
    """
    found, most = np.zeros(len(mean)), len(mean) if longest is None else longest
    edges = np.flatnonzero(np.diff(rest, prepend=True, append=True))
    for first, last in edges.reshape(-1, 2).tolist():
        clear = first + np.flatnonzero(np.abs(mean[first:last]) > REST_DEVIATIONS * deviation)
        if clear.size and first:
            found[max(first, clear[0] - most) : clear[0]] = np.sign(mean[clear[0]])
        if clear.size and last < len(mean):
            found[clear[-1] + 1 : min(last, clear[-1] + 1 + most)] = np.sign(mean[clear[-1]])
    return found


def with_direction_of_motion(mean: Array, deviation: float, rest: NDArray[np.bool_]) -> Array:
    """Return estimates of the truth (time,), those beside a rest with the direction of its motion."""
    direction, least = direction_beside_rest(mean, deviation, rest), LEAST_IN_MOTION * deviation
    return np.where((direction != 0) & ~(direction * mean >= least), direction * least, mean)


def _matters(deviation: float, known: NDArray[np.bool_], normal: NormalTruth) -> bool:
    """Return whether an error is one of which more is asked, and the readings are enough for it."""
    variance = deviation**2
    told_apart = LEAST_VARIANCE * variance < normal.prior_variance < variance / LEAST_ERROR**2
    return bool(told_apart and known.sum() >= FEWEST_READINGS)


def refined_by_density(readings: Array, deviation: float, starts: NDArray[np.int64], normal: NormalTruth) -> Array:
    """Return the truth's conditional expectation, shape (time,); `normal.mean` where a density is no clear gain.

    `readings` (time,), NaN where there are none, have normal errors of this deviation; runs begin at `starts`.
    """
    if not _matters(deviation, np.isfinite(readings), normal):
        return normal.mean
    # About its mean, a column far from 0 has all its digits in its squares.
    centred = replace(normal, mean=normal.mean - normal.prior_mean, prior_mean=0.0)
    found = _refined(readings - normal.prior_mean, deviation, starts, centred)
    return normal.mean if found is None else np.where(np.isfinite(normal.mean), found + normal.prior_mean, np.nan)


def _refined(readings: Array, deviation: float, starts: NDArray[np.int64], normal: NormalTruth) -> Array | None:
    """Return the best combination everywhere, None where it is no clear gain."""
    fitted = windows_of(readings, starts, MOST_FITTED)
    density = mixing_density(readings[np.isfinite(readings)], deviation)
    chain = JumpChain(density, normal.persistence, deviation).fitted(fitted)
    known = np.isfinite(readings[fitted.rows])
    estimates = [_at(each, known) for each in _estimates(fitted, normal, density, chain)]
    read, variance = readings[fitted.rows][known], deviation**2
    combination = best_combination(read, estimates)
    new = combination.of(estimates)
    better = clearly_better(read, variance, new, estimates[0], density.effective_count)
    if not (better and consistent(read, variance, new)):
        return None
    everywhere = windows_of(readings, starts, len(readings))
    found = combination.of(_estimates(everywhere, normal, density, chain)).mean
    known = np.isfinite(readings)
    return found if consistent_throughout(readings[known], variance, found[known]) else None


def _estimates(windows: Windows, normal: NormalTruth, density: MixingDensity, chain: JumpChain) -> list[Estimate]:
    """Return what the autoregression, the same with the density, and the chain say at the windows' rows."""
    mean = np.nan_to_num(normal.mean[windows.rows], nan=normal.prior_mean)
    variance = np.maximum(normal.variance[windows.rows], LEAST_POSTERIOR * chain.deviation**2)
    exchanged = density.reweighted(mean, variance, normal.prior_mean, normal.prior_variance)
    return [Estimate(mean, variance), Estimate(*exchanged), Estimate(*chain.posterior(windows))]


def _at(estimate: Estimate, known: NDArray[np.bool_]) -> Estimate:
    """Return an estimate at some of its instants."""
    return Estimate(estimate.mean[known], estimate.variance[known])
