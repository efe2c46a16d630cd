"""How an effect develops over the recordings of a fleet: always there, since a date, until one, or growing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]
Kind = Literal["always", "since", "until", "growing"]

POWERS = (0.5, 1.0, 2.0)
"""Powers of the time since the onset by which an effect may grow (a choice: running-in slows, wear accelerates)."""
MOST_DATES = 40
"""Dates at which an effect may begin or end, on the same rovers (a choice; evenly spread, where there are more)."""


@dataclass(frozen=True)
class Course:
    """The size of an effect in each recording, relative to its coefficient.

    Attributes
    ----------
    kind: `since` and `growing` begin with recording `first` of the rover, `until` ends before it
    first: place of that recording among all recordings of the fleet
    power: of the time since the onset, for `growing`; the size at the rover's last recording is 1
    """

    kind: Kind
    first: int = 0
    power: float = 1.0

    def factors(self, recordings: Sequence[int], when: Array) -> Array:
        """Return the relative sizes in these recordings, which are in the order of time, shape (recording,).

        `when` is the time of every recording of the fleet.
        """
        at = when[list(recordings)]
        if self.kind == "always":
            return np.ones(len(at))
        place = list(recordings).index(self.first)
        after = np.arange(len(at)) >= place
        if self.kind != "growing":
            return np.asarray(after if self.kind == "since" else ~after, np.float64)
        onset = at[place - 1] if place else at[0]
        relative = np.clip(at - onset, 0, None) / max(at[-1] - onset, 1e-300)
        return np.where(after, relative**self.power, 0.0)

    def among(self, recordings: Sequence[int], when: Array) -> Course:
        """Return the same course in fewer recordings, in the order of time: its date is of the next that is among them.

        A rover's effect begins or ends between two of its recordings (`search.place_of`): there is a next one.
        """
        if self.kind == "always" or self.first in recordings:
            return self
        return replace(self, first=next(place for place in recordings if when[place] >= when[self.first]))


def courses_over(recordings: Sequence[int], *, begins: bool) -> list[Course]:
    """Return the courses that an effect may have over recordings in the order of time.

    `begins`: it is a change by its nature, which begins after the first recording, stays, and may grow.
    """
    later = list(recordings[1:])
    if len(later) > MOST_DATES:
        later = [later[int(place)] for place in np.unique(np.linspace(0, len(later) - 1, MOST_DATES).round())]
    since = [Course("since", first) for first in later]
    if begins:
        return [*since, *(Course("growing", first, power) for first in later for power in POWERS)]
    return [Course("always"), *since, *(Course("until", first) for first in later)]
