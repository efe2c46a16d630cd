"""The state with which a run begins, where a simulation has one: known no better than a reading is.

A simulation takes it from the first reading of a column, which has noise. What that makes wrong decays as the state
forgets, and is neither physics nor noise of each reading.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.state.state_memory import longest_memory_s
from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

MOST_STATES = 24
"""Runs times wheels of which the initial state is in doubt, at most (a choice: each is one more free parameter)."""

UNKNOWN = 100.0
"""Prior standard deviation of one that is further off, in those of a reading's noise (a choice: it is hardly held back,
so that nothing else has to stand for what a wrong beginning leaves)."""


@dataclass(frozen=True, eq=False)
class InitialState:
    """The state of a wheel as a run begins.

    Attributes
    ----------
    run, rows: the number and the rows of the run
    wheel: by its index
    column: what it changes if it is off by one standard deviation of a reading's noise, shape (time, wheel)
    std: of its prior, in those
    """

    run: int
    rows: slice
    wheel: int
    column: Array
    std: float

    @property
    def name(self) -> str:
        """Its name among the free parameters."""
        return name_of(self.run, self.wheel)


def initial_states(problem: Problem) -> Iterator[InitialState]:
    """Yield each run's initial state on each wheel.

    Nothing is yielded of a simulation without a state, and of more than `MOST_STATES`.
    """
    runs, wheels = problem.recording.runs, np.flatnonzero(problem.mask.any(axis=0)).tolist()
    if len(runs) * len(wheels) > MOST_STATES or not (memory := longest_memory_s(problem)):
        return
    for wheel in wheels:
        deviation = _noise_of_a_reading(problem, wheel)
        for rows in runs if deviation > 0 else ():
            column = np.zeros(problem.mask.shape)
            since = problem.recording.time_s[rows] - problem.recording.time_s[rows.start]
            column[rows, wheel] = deviation * np.exp(-since / memory)
            run = int(problem.recording.run[rows.start])
            yield InitialState(run, rows, wheel, column, UNKNOWN if name_of(run, wheel) in problem.unknown else 1.0)


def name_of(run: int, wheel: int) -> str:
    """Return the name of an initial state among the free parameters."""
    return f"initial state of wheel {wheel} in run {run}"


def _noise_of_a_reading(problem: Problem, wheel: int) -> float:
    """Return the standard deviation of the noise that differs from reading to reading, from second differences."""
    residual = problem.residual[problem.mask[:, wheel], wheel]
    return robust_std(np.diff(residual, 2)) / np.sqrt(6) if len(residual) > 2 else 0.0
