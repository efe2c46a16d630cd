"""Columns behind a dead time or a first-order filter, in each run by itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.covariates import LONGEST_STEP
from regolithd.calibration.mismatch.signal.recursion import recursion

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]


def filtered(recording: Recording, values: Array, time_constant_s: float) -> Array:
    """Return values (time, wheel) behind a first-order filter, exact for straight lines between readings.

    Each run begins at its first value; so does what follows a gap.
    """
    steps = np.diff(recording.time_s)
    whole = (np.diff(recording.run) == 0) & (steps < LONGEST_STEP * recording.step_s)
    decay = float(np.exp(-recording.step_s / time_constant_s))
    slope = (1 - decay) * time_constant_s / recording.step_s
    begins = np.concatenate(([True], ~whole))
    added = (1 - slope) * values
    added[1:] += (slope - decay) * values[:-1]
    added[begins] = values[begins]
    return recursion(np.where(begins, 0.0, decay)[:, None], added)


def shifted(recording: Recording, values: Array, by_s: float) -> Array:
    """Return values (time, wheel) as they are `by_s` later in the same run, on straight lines; ends are held."""
    moved = np.array(values, np.float64)
    for run in np.unique(recording.run):
        here = np.flatnonzero(recording.run == run)
        if len(here) < 2:
            continue
        at, of_run = recording.time_s[here], values[here]
        known = np.isfinite(of_run)
        whole = known.all(axis=0)
        moved[here[:, None], np.flatnonzero(whole)] = _on_straight_lines(at + by_s, at, of_run[:, whole])
        for k in np.flatnonzero(~whole):
            read = known[:, k]
            if read.sum() > 1:
                moved[here, k] = np.where(read, np.interp(at + by_s, at[read], of_run[read, k]), np.nan)
    return moved


def _on_straight_lines(wanted: Array, at: Array, columns: Array) -> Array:
    """Return columns (time, column) at other times, as `np.interp` would; each time's place is found once for all."""
    left = np.clip(np.searchsorted(at, wanted, side="right") - 1, 0, len(at) - 2)
    slope = np.diff(columns, axis=0) / np.diff(at)[:, None]
    found = slope[left] * (wanted - at[left])[:, None] + columns[left]
    found[wanted <= at[0]], found[wanted >= at[-1]] = columns[0], columns[-1]
    return np.asarray(found)


def beyond_the_end(recording: Recording, by_s: float) -> NDArray[np.bool_]:
    """Return where `shifted` by so much holds the end of a run, shape (time, wheel)."""
    ends = np.zeros(recording.run.max() + 1)
    np.maximum.at(ends, recording.run, recording.time_s)
    return np.repeat((recording.time_s + by_s > ends[recording.run])[:, None], recording.shape[1], axis=1)
