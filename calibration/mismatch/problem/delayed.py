"""Columns behind a dead time or a filter of first order, in each run by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

FEWEST_OF_A_LINE = 3
"""Readings through which a straight line is drawn, at least."""


@dataclass(frozen=True, eq=False)
class Restart:
    """Where a filter's output is known, shape (time, wheel): it goes on from there, whatever it was fed with before.

    Attributes
    ----------
    where: the rows
    output, fed: what it put out there, and what it was fed with; 0 elsewhere
    """

    where: NDArray[np.bool_]
    output: Array
    fed: Array

    @property
    def of_a_change(self) -> Restart:
        """What a change of the values does not change."""
        return Restart(self.where, np.zeros(self.output.shape), np.zeros(self.fed.shape))


def restart_of(problem: Problem, delay_s: float) -> Restart | None:
    """Return what a filter has put out, and was fed with, where the simulation says nothing for the last time.

    The readings are the filter's output: a straight line through the last of them, of a third of the delay, tells it
    and its slope, and with that what goes in. None where there are too few.
    """
    count = max(int(np.ceil(delay_s / problem.recording.step_s / 3)), FEWEST_OF_A_LINE)
    where, output, slope = problem.lately(("last lines", count), lambda: _last_lines(problem, count))
    return Restart(where > 0, output, output + slope * delay_s) if where.any() else None


def _last_lines(problem: Problem, count: int) -> Array:
    """Return straight lines through so many readings before the prediction goes on after it was NaN.

    Returns
    -------
    Shape (3, time, wheel): in the last row where it is NaN 1, the line's value there, and its slope; 0 elsewhere, and
    where there are too few readings.
    """
    recording, measured, blank = problem.recording, problem.measured, np.isnan(problem.prediction)
    last = blank & ~np.pad(blank, ((0, 1), (0, 0)), constant_values=True)[1:]
    found = np.zeros((3, *blank.shape))
    for row, k in np.argwhere(last).tolist():
        rows = np.arange(max(row - count + 1, 0), row + 1)
        rows = rows[blank[rows, k] & np.isfinite(measured[rows, k]) & (recording.run[rows] == recording.run[row])]
        if len(rows) < FEWEST_OF_A_LINE:
            continue
        times, readings = recording.time_s[rows] - recording.time_s[row], measured[rows, k]
        about = times - times.mean()
        slope = float(about @ readings) / float(about @ about)
        found[:, row, k] = 1.0, float(readings.mean()) - slope * float(times.mean()), slope
    return found


def filtered(recording: Recording, values: Array, time_constant_s: float, restart: Restart | None = None) -> Array:
    """Return values (time, wheel) behind a first-order filter, exact for straight lines between readings.

    Each run begins at its first value; so does what follows a gap.
    """
    decay = float(np.exp(-recording.step_s / time_constant_s))
    slope = (1 - decay) * time_constant_s / recording.step_s
    fed = values if restart is None else np.where(restart.where, restart.fed, values)
    added = (1 - slope) * values
    added[1:] += (slope - decay) * fed[:-1]
    return _of_first_order(recording, values, decay, added, restart)


def smoothed(recording: Recording, values: Array, time_constant_s: float, restart: Restart | None = None) -> Array:
    """Return values (time, wheel) as an exponential smoothing of their readings: y_k = a y_(k−1) + (1 − a) x_k.

    A digital filter is that, with a = exp(−step / time constant). Each run begins at its first value, as above.
    """
    decay = float(np.exp(-recording.step_s / time_constant_s))
    return _of_first_order(recording, values, decay, (1 - decay) * values, restart)


def _of_first_order(recording: Recording, values: Array, decay: float, added: Array, restart: Restart | None) -> Array:
    """Return what decays from one reading to the next and is added to, from the first value of each run on."""
    begins = np.concatenate(([True], ~recording.without_gap))
    added[begins] = values[begins]
    factor = np.where(begins, 0.0, decay)[:, None]
    if restart is not None:
        added, factor = np.where(restart.where, restart.output, added), np.where(restart.where, 0.0, factor)
    return recursion(factor, added)


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
