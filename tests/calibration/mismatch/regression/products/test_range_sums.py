"""Sums over ranges of a covariate against the fit of the same columns."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.groups.region import FORMS
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting
from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read
from regolithd.calibration.mismatch.regression.products.range_sums import Ranges, known_values, range_sums


@pytest.mark.parametrize("wheels", [(0, 1), (1,)])
@pytest.mark.parametrize("named", [(), ("drag",)])
@pytest.mark.parametrize("bounds", [(3, 9), (7, 12), (0, 4)])
def test_a_range_gains_what_the_fit_of_its_columns_gains(
    wheels: tuple[int, ...], named: tuple[str, ...], bounds: tuple[int, int]
) -> None:
    """With and without a bound on either side, beside the free parameters and a name, in every form."""
    equations = equations_of(problem_of(table(drag=0.3)))
    fit = equations.fit([term_of(equations, name) for name in named])
    values = known_values(equations, "wheel_speed", "offset", wheels)
    edges = np.quantile(values, np.linspace(0.05, 0.95, 11))
    sums = range_sums(equations, as_read(equations, fit), "wheel_speed", "offset", wheels, edges)
    ranges = Ranges(np.array(bounds[:1]), np.array(bounds[1:]))
    for powers, (gain,) in zip(FORMS, sums.delta_chi2(ranges, FORMS), strict=True):
        region = sums.region(*bounds, powers)
        design, places = equations.design.extended(region.columns(*acting(equations.problem, "wheel_speed", "offset")))
        group = Group("wheel_speed", places, (0,) * len(places), ("all", "one"), region=region)
        whole = equations.over(design).fit((*fit.terms, Term(group, wheels)))
        assert gain == pytest.approx(whole.delta_chi2 - fit.delta_chi2, rel=2e-3, abs=1e-3)


def test_shares_are_of_the_readings() -> None:
    """All of them between no bound and no bound, and a tenth between deciles."""
    equations = equations_of(problem_of(table()))
    values = known_values(equations, "wheel_speed", "offset", (0, 1))
    edges = np.quantile(values, np.linspace(0.1, 0.9, 9))
    sums = range_sums(equations, as_read(equations, equations.fit(())), "wheel_speed", "offset", (0, 1), edges)
    share = sums.share(Ranges(np.array([0, 2]), np.array([10, 3])))
    assert share == pytest.approx([1.0, 0.1], abs=0.01)


def test_a_range_without_readings_gains_nothing() -> None:
    """A covariate that jumps over it leaves sums there that are rounding alone."""
    equations = equations_of(problem_of(table()))
    values = known_values(equations, "wheel_speed", "offset", (0, 1))
    top = float(values.max())
    sums = range_sums(
        equations,
        as_read(equations, equations.fit(())),
        "wheel_speed",
        "offset",
        (0, 1),
        np.array([0.0, top + 0.1, top + 0.2]),
    )
    gains = sums.delta_chi2(Ranges(np.array([2]), np.array([3])), FORMS)
    assert [float(gain[0]) for gain in gains] == [0.0] * len(FORMS)


@pytest.mark.parametrize(
    ("bounds", "lower", "upper", "origin"),
    [
        ((1, 4), 0.2, 1.4, 0.8),
        ((0, 4), -np.inf, 1.4, 1.4),
        ((1, 5), 0.2, np.inf, 0.2),
        ((4, 5), 1.4, np.inf, 1.4),
    ],
)
def test_a_range_has_the_edges_as_its_bounds(
    bounds: tuple[int, int], lower: float, upper: float, origin: float
) -> None:
    """The last one too; its polynomial counts the distance from the middle, or from the bound where there is one."""
    equations = equations_of(problem_of(table()))
    edges = np.array([0.2, 0.6, 1.0, 1.4])
    read = as_read(equations, equations.fit(()))
    region = range_sums(equations, read, "wheel_speed", "offset", (0, 1), edges).region(*bounds, (1,))
    assert (region.lower, region.upper) == (lower, upper)
    assert region.origin == pytest.approx(origin)
