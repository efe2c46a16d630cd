"""The parameters and the delays of the predicted channel and of inputs, fitted together by the simulation itself.

Parameters that are fitted without a delay stand for a part of it: a longer time constant is late as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.search import Search
from regolithd.calibration.mismatch.candidates.late_columns import SENSOR_DELAY, as_shown
from regolithd.calibration.mismatch.candidates.sensor_delay import moved_input
from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

ITERATIONS = 8
"""Steps of a search at most (a choice: it begins near, and each costs a run of the simulation for each parameter)."""


@dataclass(frozen=True, eq=False)
class Late:
    """Where the simulation fits best with late columns.

    Attributes
    ----------
    values: of the parameters
    channel: how, and by how much [s], the predicted channel is late
    inputs: how late inputs are [s], by name
    """

    values: dict[str, float]
    channel: tuple[str, float]
    inputs: dict[str, float]


def fitted_where_late(problem: Problem, inputs: Iterable[str], corrected_s: float) -> Late:
    """Return the parameters' values and the delays with which the simulation fits best, the predicted channel late.

    `inputs` are those of which the delays are fitted with it; the problem has them on time.

    The search begins at the problem's values and delays: those that were fitted without them stand for a part of it.
    The channel's goes to none, and to its double or that and the one that the simulation was corrected by,
    `corrected_s`.
    """
    assert problem.late is not None  # noqa: S101  # a search of late problems alone
    search = replace(_LateSearch.of(problem), inputs=tuple(inputs), unit_s=max(problem.late[1], corrected_s))
    with np.errstate(all="ignore"):  # a prediction may overflow on the way
        _, place = search.minimum(search.place(problem.values), ITERATIONS)
    return Late(search.values(place), search.late(place), search.late_inputs(place))


@dataclass(frozen=True, eq=False)
class _LateSearch(Search):
    """The search of a problem whose predicted channel is late.

    The first coordinate is the change of the channel's delay over a unit, the next are those of `inputs` over theirs.
    Delays have no prior: what the prior of a coordinate adds to the objective is 1 at most, a unit away. The channel's
    is the first to be changed for a difference quotient, for which the prediction that was made last is shown later.
    """

    inputs: tuple[str, ...] = ()
    unit_s: float = 1.0

    @property
    def delays(self) -> int:
        """How many coordinates are delays."""
        return 1 + len(self.inputs)

    def late(self, place: Array) -> tuple[str, float]:
        """Return how, and by how much, the channel is late at a place."""
        assert self.problem.late is not None  # noqa: S101  # a search of late problems alone
        kind, delay = self.problem.late
        return kind, max(delay + self.unit_s * float(place[0]), 0.0)

    def late_inputs(self, place: Array) -> dict[str, float]:
        """Return how late the inputs are at a place."""
        changes = zip(self.inputs, place[1 : self.delays].tolist(), strict=True)
        return {name: self.problem.on_time[name] * (1 + change) for name, change in changes}

    def values(self, place: Array) -> dict[str, float]:
        """Return the parameters' values at a place."""
        return super().values(place[self.delays :])

    def place(self, values: Mapping[str, float]) -> Array:
        """Return the place of the parameters' values with the delays of the problem."""
        return np.concatenate((np.zeros(self.delays), super().place(values)))

    def within(self, place: Array) -> Array:
        """Return a place as far as the parameters may be moved, and each delay to nothing or a unit more."""
        found = super().within(place)
        found[: self.delays] = np.clip(place[: self.delays], -1.0, 1.0)  # `late` holds it at nothing
        return found

    def left(self, place: Array) -> Array:
        """Return what the simulation leaves of the readings there, shown as late as they are, shape (reading,).

        A delay that the simulation was corrected by is not added to it: it is the one that is sought.
        """
        values, inputs = self.values(place), self.late_inputs(place)
        problem = replace(self.problem, late=self.late(place))
        try:
            on_time = self.problem.lately(f"on time {values} {inputs}", lambda: self._on_time(values, inputs))
            (shown,) = as_shown(problem, [on_time])
        except SimulationError:
            return np.full(len(self.wheel), np.nan)
        return np.asarray((problem.measured - shown - self.added_by_others)[problem.mask])

    @cached_property
    def added_by_others(self) -> Array:
        """What corrected effects other than delays add on the output, shape (time, wheel)."""
        others = tuple(effect for effect in self.problem.stated if effect.name != SENSOR_DELAY)
        return replace(self.problem, stated=others).added

    def _on_time(self, values: Mapping[str, float], inputs: Mapping[str, float]) -> Array:
        """Return the prediction without any delay, of inputs that are so late."""
        problem, recording = self.problem, self.problem.recording
        moved = {
            name: moved_input(problem, name, delay - problem.on_time[name])
            for name, delay in inputs.items()
            if delay != problem.on_time[name]
        }
        moved_problem = replace(problem, recording=recording.with_channels(**moved)) if moved else problem
        return moved_problem.changed(**values) - problem.added
