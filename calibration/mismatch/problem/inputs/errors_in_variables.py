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
the truth, and how to combine them (`signal/truths/stein.py`); where that is no clear gain, the normal model stays
alone. It also does for what the speed is computed from: a speed is differentiated, and its sign is the direction of
friction.

A sensor with noise does not read exactly 0 twice, nor as a run begins or ends: where it does, it is at rest or within
its dead band, and stays 0. A simulation may have a step there, as friction has.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.autoregressive_truths import normal_truths
from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.inputs.true_values import (
    NoisyColumn,
    Smoother,
    filtered_where_better,
    refined_by_density,
    smooth_where_better,
    still_at_rest,
    with_direction_of_motion,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.prior import SensorError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExpectedInputs:
    """A recording with conditional expectations in the place of noisy inputs.

    Attributes
    ----------
    recording: with them
    smoothers: how the readings of each wheel were smoothed, by column; of which that is not known, none
    """

    recording: Recording
    smoothers: Mapping[str, tuple[Smoother, ...]] = field(default_factory=dict)


def expected_inputs(
    recording: Recording, sensors: Mapping[str, SensorError], normal: Collection[str] = ()
) -> Recording:
    """Return the recording of `smoothed_inputs`."""
    return smoothed_inputs(recording, sensors, normal).recording


def smoothed_inputs(
    recording: Recording, sensors: Mapping[str, SensorError], normal: Collection[str] = ()
) -> ExpectedInputs:
    """Return the recording with each input that has an error replaced by its conditional expectation.

    `normal` names inputs of which no density of values is estimated.
    """
    names = [
        name for name, error in sensors.items() if name in recording.channels and (error.relative or error.absolute)
    ]
    if not names:
        return ExpectedInputs(recording)
    values = np.concatenate([recording.channels[name] for name in names], axis=1)
    owners = [name for name in names for _ in recording.wheels]
    scales = [ReadingScale.of(column, sensors[name]) for name, column in zip(owners, values.T, strict=True)]
    starts = run_starts(recording)
    stabilised = np.stack([scale.stabilised(column) for scale, column in zip(scales, values.T, strict=True)], axis=1)
    rest = at_rest(values, starts)
    truths = normal_truths(stabilised, np.array([scale.deviation for scale in scales]) ** 2, starts)
    smooth, smoothers = truths.mean.copy(), list[Smoother]()
    for k, name in enumerate(owners):
        if k and owners[k - 1] == name and np.array_equal(values[:, k - 1], values[:, k], equal_nan=True):
            smooth[:, k] = smooth[:, k - 1]  # a sensor of the whole machine
            smoothers.append(smoothers[-1])
            continue
        moving, deviation = np.where(rest[:, k], np.nan, stabilised[:, k]), scales[k].deviation
        before = truths.column(k)
        noisy = NoisyColumn(stabilised[:, k], deviation, recording.time_s, recording.run, rest[:, k])
        truth = filtered_where_better(noisy, smooth_where_better(noisy, before))
        smoothers.append(partial(_smoothed_readings, scales[k], truth.again))
        if name not in normal:
            smooth[:, k] = refined_by_density(moving, deviation, starts, truth)
        elif truth is not before:
            # A sensor that reads exactly 0 at rest reads anything else in motion.
            smooth[:, k] = truth.mean if rest[:, k].any() else still_at_rest(moving, deviation, truth).mean
        if rest[:, k].any():
            smooth[:, k] = with_direction_of_motion(smooth[:, k], deviation, rest[:, k])
    expected = np.stack([scale.readings(column) for scale, column in zip(scales, smooth.T, strict=True)], axis=1)
    parts = np.split(np.where(rest, 0.0, expected), len(names), axis=1)
    of_each = zip(*[iter(smoothers)] * len(recording.wheels), strict=True)
    return ExpectedInputs(
        recording.with_channels(**dict(zip(names, parts, strict=True))), dict(zip(names, of_each, strict=True))
    )


def _smoothed_readings(scale: ReadingScale, smoother: Smoother, readings: Array) -> Array:
    """Return readings (time,) in their unit, smoothed on the scale on which their errors are alike."""
    return scale.readings(smoother(scale.stabilised(readings)))


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
