"""The state with which a run begins, where a simulation has one: known no better than a reading is.

A simulation takes it from the first reading of a column, which has noise. What that makes wrong decays as the state
forgets, and is neither physics nor noise of each reading.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.state_memory import longest_memory_s
from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

MOST_STATES = 24
"""Runs times wheels of which the initial state is in doubt, at most (a choice: each is one more free parameter)."""


def initial_states(problem: Problem) -> Iterator[tuple[str, Array]]:
    """Yield the name of each run's initial state on each wheel, and what one standard deviation of it changes.

    That has the shape (time, wheel). Its standard deviation is that of one reading's noise. Nothing is yielded of a
    simulation without a state, of more than `MOST_STATES`, and of states whose names the problem holds.
    """
    runs, wheels = problem.recording.runs, np.flatnonzero(problem.mask.any(axis=0)).tolist()
    if len(runs) * len(wheels) > MOST_STATES or not (memory := longest_memory_s(problem)):
        return
    for wheel in wheels:
        deviation = _noise_of_a_reading(problem, wheel)
        for rows in runs:
            name = name_of(int(problem.recording.run[rows.start]), problem.recording.wheels[wheel])
            if name not in problem.held and deviation > 0:
                column = np.zeros(problem.mask.shape)
                since = problem.recording.time_s[rows] - problem.recording.time_s[rows.start]
                column[rows, wheel] = deviation * np.exp(-since / memory)
                yield name, column


def name_of(run: int, wheel: int | str) -> str:
    """Return the name of a run's initial state on a wheel."""
    return f"initial state of run {run} on {wheel}"


def _noise_of_a_reading(problem: Problem, wheel: int) -> float:
    """Return the standard deviation of the noise that differs from reading to reading, from second differences."""
    residual = problem.residual[problem.mask[:, wheel], wheel]
    return robust_std(np.diff(residual, 2)) / np.sqrt(6) if len(residual) > 2 else 0.0
