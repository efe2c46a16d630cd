"""The columns that the sums of all recordings have in common: candidates, each in a few shapes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.responses import strongest
from regolithd.calibration.mismatch.fleet.work.fleet_curve import FleetCurve
from regolithd.calibration.mismatch.regression.groups.candidate_groups import coefficient_signs

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.fleet.work.sums import Sums

MOST_SHAPES = 6
"""Shapes of a candidate's grid (a choice: the shapes that single recordings were found to have come beside them)."""
MOST_FOUND_SHAPES = 6
"""Shapes that were found in single recordings, of one candidate (a choice)."""
MOST_RESPONSES = 5
"""Responses of all recordings of which the shapes are tried (a choice: the factor of a sine has four kinds)."""
NEAR = 0.1
"""Share by which shapes about a chosen one differ from it in a number (a choice: a law is linear over so little)."""
AT_ONCE = "onset_s"
"""The shape parameter of what begins within a recording. Over a fleet it is there from its first instant."""


@dataclass(frozen=True)
class GridGroup:
    """One candidate in one shape: columns that enter together.

    Attributes
    ----------
    candidate, shape: whose columns they are
    columns: their places in the sums
    tried: how many shapes of the candidate there are to choose from
    begins: whether it is a change by its nature: it cannot have been there from the start
    """

    candidate: Candidate
    shape: Shape
    columns: tuple[int, ...]
    tried: int
    begins: bool = field(default=False)

    @property
    def named(self) -> bool:
        """Whether it is an effect that has a name; else a curve."""
        return not isinstance(self.candidate, FleetCurve)

    @property
    def signs(self) -> tuple[int, ...]:
        """The columns' signs, 0 for either."""
        return coefficient_signs(self.candidate, len(self.columns))

    @property
    def of_wheels(self) -> bool:
        """Whether each wheel has coefficients of its own."""
        return self.candidate.columns_of_wheels(self.shape, 1) is not None


def grid_of(
    candidates: Sequence[Candidate], found: Sequence[Found], first: int, rovers: Sequence[str] = ()
) -> tuple[GridGroup, ...]:
    """Return the groups, whose columns begin at place `first`; `rovers` tells whose each recording is.

    A candidate's grid is that of the recording in which its covariate reaches furthest, or what all recordings respond
    to most strongly. Faults that another channel shows (a load cell's) stay with their recording.
    """
    groups: list[GridGroup] = []
    for candidate in candidates:
        shapes = shapes_over_fleet(candidate, found) if candidate.channel is None else ()
        tried = len(shapes)
        if not shapes and candidate.channel is None:
            shapes, tried = _shapes_by_response(candidate, found, rovers)
        for shape in shapes:
            columns = tuple(range(first, first + len(candidate.coefficients)))
            groups.append(GridGroup(candidate, shape, columns, tried, begins=candidate.change_point in shape))
            first += len(columns)
    return tuple(groups)


def finer_grid(grid: Sequence[GridGroup], chosen: Sequence[GridGroup], found: Sequence[Found]) -> tuple[GridGroup, ...]:
    """Return the groups with more shapes of the candidates that were chosen, the same where there are none.

    These are all of the grid that the first shapes were taken from, and such as differ from the chosen one by little in
    each number: a law in a wrong shape leaves what another law takes up.
    """
    shapes_of: dict[str, list[Shape]] = {}
    for group in grid:
        shapes_of.setdefault(group.candidate.name, []).append(group.shape)
    more: list[GridGroup] = []
    for group in chosen:
        known = shapes_of[group.candidate.name]
        for shape in () if group.begins else (*_widest(group.candidate, found), *_near(group)):
            if shape not in known:
                known.append(shape)
                more.append(replace(group, shape=shape))
    return (*grid, *more)


def _near(group: GridGroup) -> Iterator[Shape]:
    """Yield the shapes that differ from a group's by little in one free number, on either side."""
    for name, (low, high) in group.candidate.free.items():
        value = group.shape.get(name)
        if isinstance(value, float) and value and name != group.candidate.change_point:
            for share in (1 - NEAR, 1 + NEAR):
                if low <= (near := value * share) <= high:
                    yield {**group.shape, name: near}


def _shapes_by_response(
    candidate: Candidate, found: Sequence[Found], rovers: Sequence[str]
) -> tuple[tuple[Shape, ...], int]:
    """Return the shapes that recordings respond to most strongly together, and of how many they are."""
    name = candidate.name
    of = [(rover, each.responses[name]) for rover, each in zip(rovers, found, strict=False) if name in each.responses]
    if not of:
        return (), 0
    responses = [each for _, each in of]
    best = strongest(responses, [rover for rover, _ in of], MOST_RESPONSES)
    shapes = responses[0].shapes
    return tuple(shape for place in best for shape in shapes[place]), sum(map(len, shapes))


def placed(grid: Sequence[GridGroup], sums: Sequence[Sums], first: int) -> tuple[GridGroup, ...]:
    """Return the groups with as many columns as the recordings have of them, which begin at place `first`.

    A candidate may make more columns than it has coefficients (a ripple, sine and cosine of each wheel), and fewer in a
    recording that lacks something.
    """
    found: list[GridGroup] = []
    for place, group in enumerate(grid):
        count = max((len(each.places[place]) for each in sums), default=0) or len(group.columns)
        found.append(replace(group, columns=tuple(range(first, first + count))))
        first += count
    return tuple(found)


def shapes_over_fleet(candidate: Candidate, found: Sequence[Found]) -> tuple[Shape, ...]:
    """Return a candidate's shapes for all recordings; of what begins at some time, the shape after that alone."""
    widest = _widest(candidate, found)
    if not widest:
        return ()
    change_point = candidate.change_point
    if change_point in widest[0]:
        return ({**widest[0], change_point: 0.0},)
    kept = [widest[int(place)] for place in np.unique(np.linspace(0, len(widest) - 1, MOST_SHAPES).round())]
    named = [term.shape for each in found for term in each.terms if term.named and term.name == candidate.name]
    more = {repr(sorted(shape.items())): shape for shape in named if shape not in kept}
    return (*kept, *list(more.values())[:MOST_FOUND_SHAPES])


def _widest(candidate: Candidate, found: Sequence[Found]) -> tuple[Shape, ...]:
    """Return a candidate's whole grid in the recording in which its covariate reaches furthest."""
    grids = [each.shapes[candidate.name] for each in found if candidate.name in each.shapes]
    return tuple(max(grids, key=lambda grid: (grid.reach, len(grid.shapes))).shapes) if grids else ()
