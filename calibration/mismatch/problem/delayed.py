"""Columns behind a dead time or a filter of first order, in each run by itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.recursion import recursion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]


def filtered(recording: Recording, values: Array, time_constant_s: float) -> Array:
    """Return values (time, wheel) behind a first-order filter, exact for straight lines between readings.

    Each run begins at its first value; so does what follows a gap.
    """
    decay = float(np.exp(-recording.step_s / time_constant_s))
    slope = (1 - decay) * time_constant_s / recording.step_s
    added = (1 - slope) * values
    added[1:] += (slope - decay) * values[:-1]
    return _of_first_order(recording, values, decay, added)


def smoothed(recording: Recording, values: Array, time_constant_s: float) -> Array:
    """Return values (time, wheel) as an exponential smoothing of their readings: y_k = a y_(k−1) + (1 − a) x_k.

    A digital filter is that, with a = exp(−step / time constant). Each run begins at its first value, as above.
    """
    decay = float(np.exp(-recording.step_s / time_constant_s))
    return _of_first_order(recording, values, decay, (1 - decay) * values)


def _of_first_order(recording: Recording, values: Array, decay: float, added: Array) -> Array:
    """Return what decays from one reading to the next and is added to, from the first value of each run on."""
    begins = np.concatenate(([True], ~recording.without_gap))
    added[begins] = values[begins]
    return recursion(np.where(begins, 0.0, decay)[:, None], added)


def shifted(recording: Recording, values: Array, by_s: float, on: Sequence[int] = ()) -> Array:
    """Return values (time, wheel) as they are `by_s` later in the same run, on straight lines; ends are held.

    `on` are the wheels that are shifted, by their indices; empty: all.
    """
    moved = np.array(values, np.float64)
    for rows in recording.runs:
        at, of_run = recording.time_s[rows], values[rows]
        wanted, known = at + by_s, np.isfinite(of_run)
        for k, read in enumerate(known.T):
            if on and k not in on:
                continue
            if len(at) > 1 and read.all():
                moved[rows, k] = np.interp(wanted, at, of_run[:, k])
            elif read.sum() > 1:
                moved[rows, k] = np.where(read, np.interp(wanted, at[read], of_run[read, k]), np.nan)
    return moved


def beyond_the_end(recording: Recording, by_s: float, on: Sequence[int] = ()) -> NDArray[np.bool_]:
    """Return where `shifted` by so much, on these wheels, holds the end of a run, shape (time, wheel)."""
    runs, of_run = np.unique(recording.run, return_inverse=True)  # a run's number may be a date
    ends = np.zeros(len(runs))
    np.maximum.at(ends, of_run, recording.time_s)
    wheels = np.arange(recording.shape[1])
    return (recording.time_s + by_s > ends[of_run])[:, None] & np.isin(wheels, on or wheels)
