"""In a range or everywhere, and how sure the bounds are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import NOISE, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read
from regolithd.calibration.mismatch.regression.products.range_sums import range_sums
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.by_region.region_bounds import bounds_of
from regolithd.calibration.mismatch.selection.by_region.region_search import between
from regolithd.calibration.mismatch.selection.by_region.regions import in_regions
from regolithd.calibration.mismatch.selection.decision import Decision
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def decision_with(added: Callable[[Array], Array], *, seed: int = 0, drag: float = 0.0) -> Decision:
    """Return the decision that the best smooth term stays unexplained, of a law of the speed's magnitude."""
    columns = table(seed=seed, drag=drag)
    columns["reading_V"] = columns["reading_V"] + added(np.abs(columns["speed_rad_s"]))
    equations = equations_of(problem_of(columns))
    equations = equations.over(with_smooth_terms(equations.design))
    named = equations.fit([term_of(equations, "drag")] if drag else [])
    curve = best_of_each_smooth_term(equations, named.terms)[0][1]
    noise = NoiseModel(np.full(2, NOISE), 1.0)
    return Decision(equations, noise, 8.0, named, (curve,), equations.fit((*named.terms, curve)))


def test_ranges_between_bounds_have_these_bounds() -> None:
    """Every lower one with every upper one; none stands for an open end."""
    equations = equations_of(problem_of(table()))
    edges = np.linspace(0.0, 2.0, 21)
    sums = range_sums(equations, as_read(equations, equations.fit(())), "wheel_speed", "offset", (0, 1), edges)

    def found(lower: Array, upper: Array) -> set[tuple[float, float]]:
        ranges = between(edges, lower, upper)
        regions = [sums.region(int(a), int(b), (0,)) for a, b in zip(ranges.first, ranges.last, strict=True)]
        return {(region.lower, region.upper) for region in regions}

    low, high, none = edges[[2, 5]], edges[[9, 20]], np.zeros(0)
    assert found(low, high) == {(a, b) for a in low for b in high}
    assert found(none, high) == {(-np.inf, b) for b in high}
    assert found(low, none) == {(a, np.inf) for a in low}


@pytest.mark.parametrize("drag", [0.0, 0.4])
def test_what_acts_beyond_a_speed_is_told_by_that_speed(drag: float) -> None:
    """Alone and beside a name: one bound, which is in its interval, and a parameter without bias."""
    found = in_regions(decision_with(lambda speed: np.where(speed > 1.1, 0.6, 0.0), drag=drag))
    (term,) = found.unnamed
    assert term.group.region is not None
    assert term.group.region.upper == np.inf
    lower, upper = bounds_of(found.equations, found.whole, found.whole.terms.index(term))
    assert upper is None
    assert lower is not None
    assert lower.low < 1.1 < lower.high
    assert lower.high - lower.low < 0.1
    shift = found.whole.coefficients[0] / found.equations.design.scale[found.equations.nuisance.columns[0]]
    assert abs(shift) < 0.03


def test_a_band_has_two_bounds() -> None:
    """Between two speeds."""
    found = in_regions(decision_with(lambda speed: np.where((speed > 0.7) & (speed < 1.2), 0.5, 0.0)))
    (term,) = found.unnamed
    lower, upper = bounds_of(found.equations, found.whole, 0)
    assert lower is not None
    assert upper is not None
    assert lower.low < 0.7 < lower.high
    assert upper.low < 1.2 < upper.high
    assert term.group.region is not None


def test_two_regions_are_two() -> None:
    """Apart from each other, each with its own bounds."""
    found = in_regions(decision_with(lambda speed: np.where(speed > 1.6, 1.0, 0.0) - np.where(speed < 0.5, 0.6, 0.0)))
    regions = sorted((term.group.region for term in found.unnamed if term.group.region), key=lambda each: each.lower)
    assert [each.lower for each in regions] == [-np.inf, pytest.approx(1.6, abs=0.05)]
    assert [each.upper for each in regions] == [pytest.approx(0.5, abs=0.05), np.inf]


@pytest.mark.parametrize(
    "law",
    [
        lambda speed: 0.5 * speed,
        lambda speed: 0.3 * speed**2,
        lambda speed: 0.7 * np.exp(-speed / 0.8),
        lambda speed: 0.5 * np.sin(2 * speed),
    ],
)
def test_a_law_that_holds_everywhere_is_in_no_region(law: Callable[[Array], Array]) -> None:
    """The decision comes back as it was."""
    decision = decision_with(law)
    assert in_regions(decision) is decision


def test_an_interval_of_a_bound_holds_it_nine_times_in_ten() -> None:
    """At least, over six recordings; and it is not so wide as to say nothing."""
    held, widths = 0, []
    for seed in range(6):
        found = in_regions(decision_with(lambda speed: np.where(speed > 1.1, 0.4, 0.0), seed=seed))
        lower, _ = bounds_of(found.equations, found.whole, 0)
        assert lower is not None
        held += lower.low < 1.1 < lower.high
        widths.append(lower.high - lower.low)
    assert held >= 5
    assert np.median(widths) < 0.3


def test_without_anything_unexplained_nothing_changes() -> None:
    """A decision without a smooth term comes back as it was."""
    decision = decision_with(lambda speed: 0 * speed)
    nothing = Decision(decision.equations, decision.noise, 8.0, decision.named, (), decision.named)
    assert in_regions(nothing) is nothing
