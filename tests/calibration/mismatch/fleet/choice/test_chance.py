"""The score that the search over a fleet finds by chance."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic_fleet import DRAG, WEAR, WHEELS, drive, equations_of, on_both, term

from regolithd.calibration.mismatch.fleet.choice import chance
from regolithd.calibration.mismatch.fleet.choice.chance import entry_threshold
from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.search import course_cost, further, may_share, penalty, places_of
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations

ROVER = (0, 1, 0, 1)
EQUATIONS = equations_of([drive(n) for n in range(4)], ROVER)
SINGLE = (DRAG, WEAR)


def test_blocks_get_new_signs_wheel_by_wheel() -> None:
    """A draw's moment has mean 0 and the sum of the blocks' squares as its variance; all columns have one sign."""
    generator = np.random.default_rng(1)
    drawn = np.concatenate([chance._drawn(EQUATIONS, generator) for _ in range(40)])
    blocks = np.array([sums.blocks for sums in EQUATIONS.sums])
    spread = np.sqrt(np.sum(blocks**2, axis=1))
    assert np.max(np.abs(drawn.mean(axis=0)) / spread) < 5 / np.sqrt(len(drawn))
    np.testing.assert_allclose(drawn.std(axis=0), spread, rtol=0.1)
    products = np.einsum("diwc,diwe->iwce", drawn, drawn) / len(drawn)
    np.testing.assert_allclose(products, np.einsum("ibwc,ibwe->iwce", blocks, blocks), atol=0.15 * np.max(spread) ** 2)


def test_a_wheel_that_a_recording_lacks_has_no_draws() -> None:
    """The blocks of the other wheel keep their place."""
    sums = [each.sums() for each in (drive(0), drive(1))]
    names = ("gram", "moment", "fourth", "energy", "counts", "weights")
    lacking = replace(
        sums[0],
        wheels=("right",),
        blocks=sums[0].blocks[:, 1:],
        **{name: getattr(sums[0], name)[1:] for name in names},
    )
    equations = fleet_equations([lacking, sums[1]], (0, 0), (0.0, 1.0), EQUATIONS.groups, "rover")
    drawn = chance._drawn(equations, np.random.default_rng(0))
    assert not drawn[:, 0, 0].any()
    assert drawn[:, 0, 1].all()


def scores_by_fits(drawn: FleetEquations, beside: tuple[FleetTerm, ...]) -> Iterator[float]:
    """Yield the score of every candidate of one column, wherever it may be, from fits with it."""
    before = drawn.fit(beside)
    for place in places_of(drawn):
        for group in SINGLE:
            if not may_share(group, place.units, len(WHEELS)):
                continue
            courses = place.courses(group)
            for course in courses:
                fit = drawn.fit((*beside, FleetTerm(group, place.units, course)))
                gained = fit.delta_chi2 - before.delta_chi2 if fit.coefficients[-1] > 0 else 0.0
                chosen = penalty(drawn, FleetTerm(group, place.units, courses[-1])) - course_cost(courses[-1])
                yield gained - chosen - course_cost(course)


@pytest.mark.parametrize("beside", [(), (term(DRAG, Course("always"), wheels=(0,)),)])
def test_a_draw_is_searched_as_the_fleet_is(beside: tuple[FleetTerm, ...]) -> None:
    """Its largest score is that of all fits of a further candidate to the drawn moments."""
    moments = chance._drawn(EQUATIONS, np.random.default_rng(2))[:5]
    largest = chance._largest_scores(EQUATIONS, EQUATIONS.fit(beside), moments, places_of(EQUATIONS))
    for moment, found in zip(moments, largest, strict=True):
        assert found == pytest.approx(max(scores_by_fits(replace(EQUATIONS, moment=moment), beside)))


def test_the_threshold_is_a_quantile_of_the_largest_scores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plus its own error, of as many draws as are stated, and within limits."""
    draws: list[int] = []

    def scores(value: float) -> object:
        def largest(*given: object) -> np.ndarray:
            draws.append(len(given[2]))  # type: ignore[arg-type]
            return np.full(len(given[2]), value)  # type: ignore[arg-type]

        return largest

    for value, expected in ((6.5, 7.5), (-50.0, THRESHOLDS.least_entry), (50.0, THRESHOLDS.largest_entry)):
        monkeypatch.setattr(chance, "_largest_scores", scores(value))
        assert entry_threshold(EQUATIONS, places_of(EQUATIONS)) == pytest.approx(expected)
    assert sum(draws) == 3 * chance.DRAWS


def test_noise_hardly_ever_passes_the_threshold() -> None:
    """And an effect of moderate size does."""
    places = places_of(EQUATIONS)
    threshold = entry_threshold(EQUATIONS, places)
    assert THRESHOLDS.least_entry <= threshold <= THRESHOLDS.largest_entry
    assert further(EQUATIONS, EQUATIONS.fit(()), places, SINGLE)[0][0] < threshold
    shown = equations_of([drive(n, on_both(1, 0.05)) for n in range(4)], ROVER)
    assert further(shown, shown.fit(()), places_of(shown), SINGLE)[0][0] > threshold
