"""The shapes in which candidates are searched over a fleet, and the places of their columns."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from sample_answer import FINDINGS
from synthetic_fleet import DEVIATION, Drag, Wave, Wear, drive

from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm, Shapes
from regolithd.calibration.mismatch.fleet.work.grid import (
    MOST_FOUND_SHAPES,
    MOST_SHAPES,
    finer_grid,
    grid_of,
    placed,
    shapes_over_fleet,
)


class OfLoadCell(Drag):
    """A fault of another channel."""

    name, channel = "cell", "load_N"


def powers(count: int, first: float = 0.0) -> tuple[dict[str, float | str], ...]:
    """Return shapes of a power law."""
    return tuple({"power": first + n} for n in range(count))


def found(terms: tuple[FoundTerm, ...] = (), **shapes: Shapes) -> Found:
    """Return what a recording shows, with the grids of candidates; `_` in a name stands for a hyphen."""
    return Found(
        FINDINGS, {}, DEVIATION, 1.0, 0.1, 8.0, terms, {name.replace("_", "-"): each for name, each in shapes.items()}
    )


def shown(power: float, *, name: str = "steady-drag", named: bool = True) -> FoundTerm:
    """Return a term that a recording shows with this shape."""
    return FoundTerm(name, named, {"power": power}, (0, 1), 2.0, np.zeros((1, 1, 2), np.float32))


def test_the_grid_is_that_of_the_recording_whose_covariate_reaches_furthest() -> None:
    """And the larger one, where they reach as far."""
    near, far = Shapes(1.0, powers(5)), Shapes(2.0, powers(2, 10.0))
    assert shapes_over_fleet(Drag(), [found(steady_drag=near), found(steady_drag=far), found()]) == far.shapes
    larger = Shapes(2.0, powers(3))
    assert shapes_over_fleet(Drag(), [found(steady_drag=far), found(steady_drag=larger)]) == larger.shapes


def test_a_candidate_that_no_recording_allows_has_no_shapes() -> None:
    """Nor has one whose shapes come from a residual alone."""
    assert shapes_over_fleet(Drag(), [found(), found(wear=Shapes(0.0, ({},)))]) == ()
    assert shapes_over_fleet(Drag(), [found(steady_drag=Shapes(1.0, ()))]) == ()


def test_a_fine_grid_is_thinned_out_evenly() -> None:
    """With its first and its last shape."""
    shapes = shapes_over_fleet(Drag(), [found(steady_drag=Shapes(1.0, powers(11)))])
    assert [shape["power"] for shape in shapes] == [0, 2, 4, 6, 8, 10]
    assert len(shapes) == MOST_SHAPES


def test_shapes_that_recordings_were_found_to_have_come_beside_the_grid() -> None:
    """Each once, named ones of this candidate alone, and not too many."""
    grid = Shapes(1.0, powers(2))
    terms = (shown(1.0), shown(0.3), shown(0.3), shown(0.4, named=False), shown(0.5, name="wear"))
    assert shapes_over_fleet(Drag(), [found(terms, steady_drag=grid)]) == (*grid.shapes, {"power": 0.3})
    many = tuple(shown(0.1 * n) for n in range(1, 10))
    assert len(shapes_over_fleet(Drag(), [found(many, steady_drag=grid)])) == len(grid.shapes) + MOST_FOUND_SHAPES


def test_what_begins_within_a_recording_is_there_from_its_first_instant_over_a_fleet() -> None:
    """Its onset is a date then: one shape, with the rest as in the grid."""
    grid = Shapes(0.0, ({"onset_s": 12.0, "rise_s": 3.0}, {"onset_s": 40.0, "rise_s": 3.0}))
    assert shapes_over_fleet(Wear(), [found(wear=grid)]) == ({"onset_s": 0.0, "rise_s": 3.0},)


def test_each_shape_has_columns_of_its_own() -> None:
    """One after the other from a given place; faults of another channel have none."""
    grids = found(
        steady_drag=Shapes(1.0, powers(2)), wave=Shapes(1.0, ({},)), wear=Shapes(0.0, ({"onset_s": 5.0},)),
        cell=Shapes(1.0, ({},)),
    )  # fmt: skip
    groups = grid_of((Drag(), OfLoadCell(), Wave(), Wear()), [grids], 7)
    assert [(group.candidate.name, group.columns, group.tried, group.begins) for group in groups] == [
        ("steady-drag", (7,), 2, False),
        ("steady-drag", (8,), 2, False),
        ("wave", (9, 10), 1, False),
        ("wear", (11,), 1, True),
    ]
    assert [group.shape for group in groups] == [{"power": 0.0}, {"power": 1.0}, {}, {"onset_s": 0.0}]
    assert [group.signs for group in groups] == [(1,), (1,), (0, 0), (1,)]


def test_a_group_has_as_many_columns_as_recordings_have_of_it() -> None:
    """A candidate may make more than it has coefficients; where no recording allows it, there are as many as those."""
    grids = found(steady_drag=Shapes(1.0, ({},)), wave=Shapes(1.0, ({},)), wear=Shapes(0.0, ({"onset_s": 5.0},)))
    grid = grid_of((Drag(), Wear(), Wave()), [grids], 0)
    sums = [replace(drive(0).sums(), places=places) for places in (((1,), (), (2, 3)), ((1, 2, 3), (), ()))]
    groups = placed(grid, sums, 1)
    assert [group.columns for group in groups] == [(1, 2, 3), (4,), (5, 6)]
    assert [group.signs for group in groups] == [(1, 0, 0), (1,), (0, 0)]


class Stretched(Drag):
    """A drag with a power that is free, and a number that is not."""

    free: ClassVar = {"power": (0.0, 10.5)}


def test_a_finer_grid_has_all_shapes_of_what_was_chosen_and_such_near_to_it() -> None:
    """Of the others none; a tenth less and more, as far as the bounds allow; columns and prices stay as they were."""
    grids = [found(steady_drag=Shapes(1.0, powers(11)), wave=Shapes(1.0, powers(11)))]
    grid = grid_of((Stretched(), Wave()), grids, 3)
    chosen = [group for group in grid if group.candidate.name == "steady-drag" and group.shape["power"] == 10]
    more = finer_grid(grid, [replace(each, shape={"power": 10.0, "kind": 1.0}) for each in chosen], grids)
    assert more[: len(grid)] == grid
    shapes = [group.shape for group in more[len(grid) :]]
    assert shapes == [*({"power": power} for power in (1, 3, 5, 7, 9)), {"power": 9.0, "kind": 1.0}]
    assert {(group.candidate.name, group.tried) for group in more[len(grid) :]} == {("steady-drag", grid[0].tried)}


def test_a_grid_is_no_finer_for_what_has_one_shape_or_begins() -> None:
    """Nor where nothing was chosen."""
    grids = [found(steady_drag=Shapes(1.0, ({},)), wear=Shapes(0.0, tuple({"onset_s": float(n)} for n in range(9))))]
    grid = grid_of((Drag(), Wear()), grids, 1)
    assert finer_grid(grid, grid, grids) == grid
    assert finer_grid(grid, (), grids) == grid
