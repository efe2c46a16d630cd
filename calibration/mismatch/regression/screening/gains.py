"""What groups would gain beside a fit on each set of wheels: a table, of which a search makes few terms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Group, Term

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gains:
    """The further Δχ² of groups on sets of wheels.

    Attributes
    ----------
    groups, sets: what may enter, and on which wheels
    values: Δχ², shape (set, group); 0 where there is nothing to gain, or where the wheels may not share the group
    penalties: what each has to gain beyond chance, in Δχ², of the same shape
    """

    groups: tuple[Group, ...]
    sets: tuple[tuple[int, ...], ...]
    values: Array
    penalties: Array

    def largest_score(self) -> tuple[float, Term] | None:
        """Return the term with the largest Δχ² less penalty; None where nothing gains anything."""
        if not self.values.any():
            return None
        scores = np.where(self.values > 0, self.values - self.penalties, -np.inf)
        best = int(np.argmax(scores))
        return float(scores.flat[best]), self.term(best)[1]

    def term(self, place: int) -> tuple[float, Term]:
        """Return one of them, by its place in the flattened table, with its Δχ²."""
        of_set, of_group = divmod(place, len(self.groups))
        return float(self.values[of_set, of_group]), Term(self.groups[of_group], self.sets[of_set])

    def terms(self) -> list[tuple[float, Term]]:
        """Return all that gain something, with their Δχ²."""
        return [self.term(place) for place in np.flatnonzero(self.values).tolist()]

    def where(self, allowed: NDArray[Any] | Sequence[Sequence[bool]]) -> Gains:
        """Return the gains of those that are allowed, shape (set, group), alone."""
        return replace(self, values=np.where(allowed, self.values, 0.0))

    def families(self, key: Callable[[Group], Hashable]) -> list[Gains]:
        """Return the gains of groups with the same key together."""
        places: dict[Hashable, list[int]] = {}
        for place, group in enumerate(self.groups):
            places.setdefault(key(group), []).append(place)
        return [
            Gains(tuple(self.groups[k] for k in at), self.sets, self.values[:, at], self.penalties[:, at])
            for at in places.values()
        ]

    def by_number_of_wheels(self) -> list[Gains]:
        """Return the gains on sets of equally many wheels together."""
        numbers = sorted({len(wheels) for wheels in self.sets})
        rows = [[row for row, wheels in enumerate(self.sets) if len(wheels) == number] for number in numbers]
        return [
            Gains(self.groups, tuple(self.sets[row] for row in some), self.values[some], self.penalties[some])
            for some in rows
        ]
