"""Intervals of an effect's sizes and shapes: values between the shapes of the grid are in them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from synthetic_fleet import GROUPS, WAVE, Drag, drive, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.intervals import size_stds
from regolithd.calibration.mismatch.fleet.choice.selection import relative_size
from regolithd.calibration.mismatch.fleet.told.sizes import mean_sizes, moved_law, parameters_of, size_with_std
from regolithd.calibration.mismatch.fleet.work.grid import GridGroup
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Parameter
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

SIZE, POWER = 0.3, 0.86


class Power(Drag):
    """A drag that grows with a power of the speed; a factor in its shape multiplies its column."""

    scaled_by = "factor"
    free: ClassVar = {"power": (0.5, 1.5)}


def season(factor: float = 1.0, *, alone: bool = False) -> tuple[FleetEquations, FleetFit]:
    """Return the fit of the grid's power of 0.75 where 0.86 acts, beside a column of 1.0; `alone` without that."""
    sums = []
    for n in range(6):
        plain = drive(n)
        speed = 1.0 + np.abs(plain.columns[1])
        columns = plain.columns.copy()
        columns[1], columns[2] = speed**0.75, factor * speed
        sums.append(replace(plain, columns=columns, residual=plain.residual + SIZE * speed**POWER).sums())
    first = GridGroup(Power(), {"power": 0.75, "factor": 1.0}, (1,), 2)
    second = GridGroup(Power(), {"power": 1.0, "factor": factor}, (2,), 2)
    groups = [first, GROUPS[1] if alone else second, WAVE]
    of = fleet_equations(sums, (0,) * 6, range(6), groups, "rover")
    return of, of.fit((term(first, Course("always")),))


def told(of: FleetEquations, fit: FleetFit) -> dict[str, Parameter]:
    """Return what is told of the one effect."""
    return parameters_of(of, fit, size_stds(of, fit), 0, "A", {})


def test_an_interval_holds_the_value_and_the_truth_between_two_shapes() -> None:
    """Of the shape, and of the size that goes with it; the value is that of the grid."""
    of, fit = season()
    found = told(of, fit)
    assert found["power"].value == 0.75
    assert found["power"].low <= 0.75 < POWER < found["power"].high < 1.2
    assert found["drag"].low < SIZE < found["drag"].value < found["drag"].high


def test_the_law_moves_to_where_the_recordings_have_it() -> None:
    """To first order; what multiplies a shape's column does not matter."""
    of, fit = season()
    law, std = moved_law(of, fit, 0, "power") or pytest.fail("no other shape")
    assert law.shape["power"] == pytest.approx(POWER, abs=2 * std)
    assert law.sizes[0] == pytest.approx(SIZE, abs=2 * float(law.spread[0]))
    scaled, same = moved_law(*season(4.0), 0, "power") or pytest.fail("no other shape")
    assert scaled.shape["power"] == pytest.approx(law.shape["power"])
    assert (scaled.sizes[0], same) == pytest.approx((law.sizes[0], std))


def test_a_shape_without_another_one_has_no_interval() -> None:
    """The value is told, and the interval of the size at this shape, off as a whole by as much as in one recording."""
    of, fit = season(alone=True)
    found = told(of, fit)
    assert found["power"].value == 0.75
    assert np.isnan([found["power"].low, found["power"].high]).all()
    as_a_whole = THRESHOLDS.size_discrepancy_std * found["drag"].value
    reach = 1.6449 * np.hypot(size_stds(of, fit)[fit.spans[0]][0], as_a_whole)
    assert found["drag"].high - found["drag"].value == pytest.approx(reach, rel=1e-3)


class Usual(Power):
    """The same with an exponent that has its usual values alone in the grid."""

    refined: ClassVar = {"exponent": (0.5, 3.0)}


def test_a_number_of_which_the_grid_has_usual_values_alone_has_no_interval() -> None:
    """It was not fitted: an interval of no width would say that it is certain."""
    of, _ = season()
    shape = {"power": 0.75, "factor": 1.0, "exponent": 1.0}
    groups = (replace(of.groups[0], candidate=Usual(), shape=shape), *of.groups[1:])
    of = replace(of, groups=groups)
    found = told(of, of.fit((term(groups[0], Course("always")),)))
    assert found["exponent"].value == 1.0
    assert np.isnan([found["exponent"].low, found["exponent"].high]).all()


def test_the_interval_of_a_size_is_not_wider_for_a_coefficient_near_0() -> None:
    """A wave with a sine alone is known as well as its sine, though its cosine may be anything about 0."""
    drives = [drive(n, {(3, 0): 0.3, (3, 1): 0.3}) for n in range(6)]
    of = fleet_equations([each.sums() for each in drives], (0,) * 6, range(6), GROUPS, "rover")
    fit = of.fit((term(WAVE, Course("always")),))
    size, std = size_with_std(of, of, fit, 0)
    sine, cosine = fit.coefficients[fit.spans[0]]
    assert abs(cosine) < 0.03 * sine
    of_sine = float(size_stds(of, fit)[fit.spans[0]][0]) / sine
    assert std / size == pytest.approx(np.hypot(of_sine, THRESHOLDS.size_discrepancy_std), rel=0.02)


def test_the_interval_of_a_size_holds_what_its_shape_leaves_open() -> None:
    """The size at the other shape is as far away as the shape's own standard deviation says."""
    of, fit = season()
    size, std = size_with_std(of, of, fit, 0)
    alone = size_with_std(*[season(alone=True)[0]] * 2, season(alone=True)[1], 0)
    other = of.fit((term(of.groups[1], Course("always")),))
    _, of_power = moved_law(of, fit, 0, "power") or pytest.fail("no other shape")
    moved = (relative_size(of, other, 0, 0.0) - size) / 0.25 * of_power
    assert alone[0] == pytest.approx(size)
    assert std == pytest.approx(np.hypot(alone[1], moved), rel=0.02)


def test_a_size_of_each_rover_s_scatters_as_they_do() -> None:
    """Twice as large on one rover as on the other."""
    drives = [drive(n, {(1, 0): size, (1, 1): size}) for n, size in enumerate((0.2, 0.2, 0.4, 0.4))]
    of = fleet_equations([each.sums() for each in drives], (0, 0, 1, 1), range(4), GROUPS, "rover")
    both = term(GROUPS[0], Course("always"), rovers=(0, 1))
    fit = of.fit((replace(both, units=replace(both.units, each=True)),))
    size, std = size_with_std(of, of, fit, 0)
    assert std / size == pytest.approx(1 / 3, abs=0.05)


def test_a_coefficient_that_nothing_tells_has_no_weight() -> None:
    """A rover in whose recordings a law's column is 0 has neither a size nor a standard deviation."""
    with np.errstate(all="raise"):
        found = mean_sizes(np.array([1.0, 0.0, 1.2]), np.array([0.1, 0.0, 0.1]), 1)
        nothing = mean_sizes(np.zeros(2), np.zeros(2), 1)
    np.testing.assert_allclose(found, mean_sizes(np.array([1.0, 1.2]), np.array([0.1, 0.1]), 1))
    np.testing.assert_array_equal(nothing, 0.0)
