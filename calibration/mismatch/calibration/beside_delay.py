"""The parameters and the delay of the predicted channel, fitted together by the simulation itself.

Parameters that are fitted without a delay stand for a part of it: a longer time constant is late as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.search import Search
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay, as_shown
from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

ITERATIONS = 8
"""Steps of a search at most (a choice: it begins near, and each costs a run of the simulation for each parameter)."""


def fitted_where_late(problem: Problem, corrected_s: float) -> tuple[dict[str, float], tuple[str, float]]:
    """Return the parameters' values and the delay with which the simulation fits best, the predicted channel late.

    The search begins at the problem's values and delay: those that were fitted without it stand for a part of it. It
    goes to no delay, and to twice the delay or the delay and that which the simulation was corrected by, `corrected_s`.
    """
    assert problem.late is not None  # noqa: S101  # a search of late problems alone
    search = replace(_LateSearch.of(problem), unit_s=max(problem.late[1], corrected_s))
    with np.errstate(all="ignore"):  # a prediction may overflow on the way
        _, place = search.minimum(search.place(problem.values), ITERATIONS)
    return search.values(place), search.late(place)


@dataclass(frozen=True, eq=False)
class _LateSearch(Search):
    """The search of a problem whose predicted channel is late; the first coordinate is the delay's change over a unit.

    The delay has no prior: what the prior of a coordinate adds to the objective is 1 at most, a unit away. It is the
    first to be changed for a difference quotient, for which the prediction that was made last is shown later.
    """

    unit_s: float = 1.0

    def late(self, place: Array) -> tuple[str, float]:
        """Return how, and by how much, the channel is late at a place."""
        assert self.problem.late is not None  # noqa: S101  # a search of late problems alone
        kind, delay = self.problem.late
        return kind, max(delay + self.unit_s * float(place[0]), 0.0)

    def values(self, place: Array) -> dict[str, float]:
        """Return the parameters' values at a place."""
        return super().values(place[1:])

    def place(self, values: Mapping[str, float]) -> Array:
        """Return the place of the parameters' values with the delay of the problem."""
        return np.concatenate(([0.0], super().place(values)))

    def within(self, place: Array) -> Array:
        """Return a place as far as the parameters may be moved, and the delay to nothing or a unit more."""
        found = super().within(place)
        found[0] = np.clip(place[0], -1.0, 1.0)  # `late` holds it at nothing
        return found

    def left(self, place: Array) -> Array:
        """Return what the simulation leaves of the readings there, shown as late as they are, shape (reading,).

        A delay that the simulation was corrected by is not added to it: it is the one that is sought.
        """
        problem, values = replace(self.problem, late=self.late(place)), self.values(place)
        try:
            on_time = self.problem.lately(f"on time {values}", lambda: problem.changed(**values) - problem.added)
            (shown,) = as_shown(problem, [on_time])
        except SimulationError:
            return np.full(len(self.wheel), np.nan)
        others = tuple(effect for effect in problem.stated if effect.name != SensorDelay.name)
        return np.asarray((problem.measured - shown - replace(problem, stated=others).added)[problem.mask])
