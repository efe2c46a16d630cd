"""The search over a fleet: where an effect may be, since when, what it gains, and what it has to gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fleet import DRAG, GROUPS, WAVE, WEAR, drive, equations_of, on_both, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.search import (
    course_cost,
    further,
    may_share,
    penalty,
    places_of,
    score,
)
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units

ROVER = (0, 1, 0, 1, 0, 1)
CONCEALED = {**on_both(1, 0.1), (2, 1): 0.2, (3, 0): 0.15, (4, 1): -0.1}
DRIVES = [drive(10 + n, CONCEALED if n >= 2 else {(1, 0): 0.05}) for n in range(6)]
EQUATIONS = equations_of(DRIVES, ROVER)
WHOLE_FLEET, FIRST_ROVER = Units((0, 1), (0, 1)), Units((0,), (0, 1))


def test_an_effect_may_be_on_the_fleet_a_rover_or_a_wheel() -> None:
    """Each with its recordings in the order of time."""
    places = places_of(EQUATIONS)
    assert [(place.units.rovers, place.units.sharing, place.units.wheels) for place in places] == [
        (rovers, *of_wheels)
        for rovers in ((0, 1), (0,), (1,))
        for of_wheels in (("all", (0, 1)), ("one", (0,)), ("one", (1,)))
    ]
    assert [place.recordings for place in places] == [*[(0, 1, 2, 3, 4, 5)] * 3, *[(0, 2, 4)] * 3, *[(1, 3, 5)] * 3]


def test_wheels_that_share_an_effect_are_a_place_of_their_own() -> None:
    """Sets of one wheel or of all are others already."""
    three = replace(
        DRIVES[0].sums(wheel_sets=((0, 2), (1,), (0, 1, 2))),
        wheels=("a", "b", "c"),
        gram=np.zeros((3, 5, 5)),
        moment=np.zeros((3, 5)),
        energy=np.ones(3),
        counts=np.ones(3),
        weights=np.ones(3),
    )
    equations = fleet_equations([three], [0], [0.0], GROUPS, "rover")
    kinds = [(place.units.sharing, place.units.wheels) for place in places_of(equations)]
    assert kinds == [("all", (0, 1, 2)), ("one", (0,)), ("one", (1,)), ("one", (2,)), ("some", (0, 2))]


def test_a_fleet_s_effect_begins_at_a_date_that_every_rover_has_seen() -> None:
    """Otherwise a rover that came later would look like a date; an effect that was always there needs none."""
    equations = equations_of(DRIVES, (0, 0, 1, 1, 0, 1))
    fleet = places_of(equations)[0]
    assert {course.kind for course in fleet.stands} == {"always", "since", "until"}
    assert {course.first for course in fleet.stands if course.kind != "always"} == {3, 4}
    assert {course.first for course in fleet.begins} == {3, 4}


@pytest.mark.parametrize("beside", [(), (term(DRAG, Course("always")),)])
def test_what_a_further_term_gains_is_what_the_fit_with_it_gains(beside: tuple[FleetTerm, ...]) -> None:
    """The best first, one for each candidate on each set of units, none without a gain."""
    fit = EQUATIONS.fit(beside)
    found = further(EQUATIONS, fit, places_of(EQUATIONS))
    assert len(found) >= 10
    assert len({(one.name, one.units) for _, one in found}) == len(found)
    assert [value for value, _ in found] == sorted((value for value, _ in found), reverse=True)
    for value, one in found:
        more = EQUATIONS.fit((*beside, one))
        assert value == pytest.approx(more.delta_chi2 - fit.delta_chi2 - penalty(EQUATIONS, one))
        assert value > -penalty(EQUATIONS, one)


def test_the_course_that_gains_most_is_chosen() -> None:
    """Of each candidate, among all that it may have on a set of units; growth has to gain what its power costs."""
    fit, places = EQUATIONS.fit(()), places_of(EQUATIONS)
    for value, one in further(EQUATIONS, fit, places):
        (place,) = [each for each in places if each.units == one.units]
        others = [replace(one, course=course) for course in place.courses(one.group)]
        scores = [EQUATIONS.fit((other,)).delta_chi2 - course_cost(other.course) for other in others]
        assert EQUATIONS.fit((one,)).delta_chi2 - course_cost(one.course) == pytest.approx(max(scores))
        assert value <= max(scores)


def test_the_search_may_be_among_some_candidates() -> None:
    """Others have no part in it."""
    found = further(EQUATIONS, EQUATIONS.fit(()), places_of(EQUATIONS), [WAVE])
    assert {one.name for _, one in found} == {"wave"}


def test_an_effect_of_the_wrong_sign_gains_nothing() -> None:
    """A drag does not push; a wave has either sign."""
    pushed = equations_of([drive(n, {**on_both(1, -0.5), **on_both(4, -0.5)}) for n in range(2)], (0, 0))
    names = {one.name for _, one in further(pushed, pushed.fit(()), places_of(pushed)[:1])}
    assert names == {"wave"}


@pytest.mark.parametrize(
    ("one", "expected"),
    [
        (FleetTerm(DRAG, WHOLE_FLEET, Course("always")), 2.0),
        (FleetTerm(DRAG, replace(WHOLE_FLEET, each=True), Course("always")), 2 * 2.0),
        (FleetTerm(WAVE, WHOLE_FLEET, Course("always")), 2 * 2.0),
        (FleetTerm(DRAG, FIRST_ROVER, Course("always")), 2.0 + 2 * np.log(2 * 2)),
        (FleetTerm(DRAG, FIRST_ROVER, Course("since", 2)), 2.0 + 2 * np.log(2 * 2) + 2 * np.log(5)),
        (FleetTerm(DRAG, Units((0,), (0,), "one"), Course("always")), 2.0 + 2 * np.log(2 * 4) + 6.0),
        (FleetTerm(WEAR, Units((0,), (0,), "one"), Course("since", 2)), 2.0 + 2 * np.log(2 * 4) + 2 * np.log(8)),
    ],
)
def test_a_term_pays_for_its_coefficients_and_for_having_been_chosen(one: FleetTerm, expected: float) -> None:
    """Two a coefficient, 2 ln of the courses, rovers and wheels, and six for one wheel of an effect of all."""
    assert penalty(EQUATIONS, one) == pytest.approx(expected)


def test_a_term_pays_for_its_shapes_and_for_being_hardly_possible() -> None:
    """The largest penalty that any recording states."""
    group = replace(DRAG, tried=3)
    sums = [replace(DRIVES[n].sums(), penalties=np.array([4.0 * n, 0.0, 0.0])) for n in range(2)]
    equations = fleet_equations(sums, (0, 0), (0.0, 1.0), (group, WEAR, WAVE), "rover")
    one = FleetTerm(group, Units((0,), (0, 1)), Course("always"))
    assert penalty(equations, one) == pytest.approx(2.0 + 2 * np.log(3) + 4.0)
    fit = equations.fit((one,))
    assert score(equations, fit) == pytest.approx(fit.delta_chi2 - penalty(equations, one))


@pytest.mark.parametrize(
    ("group", "kinds"),
    [
        (DRAG, {"all", "some", "one"}),
        (WEAR, {"one"}),
        (WAVE, {"all"}),
    ],
)
def test_a_candidate_says_on_which_wheels_it_may_be(group: object, kinds: set[str]) -> None:
    """A machine with one wheel has every effect on that."""
    assert {kind for kind in ("all", "some", "one") if may_share(group, Units((0,), (0,), kind), 2)} == kinds  # type: ignore[arg-type]
    assert may_share(WEAR, Units((0,), (0,)), 1)


@pytest.mark.parametrize(("last", "kind"), [(0.35, "since"), (0.6, "growing")])
def test_growth_is_ahead_of_a_step_by_evidence_or_it_is_a_step(last: float, kind: str) -> None:
    """Of two recordings after a date, sizes that hardly differ are one size."""
    drives = [drive(n, {(2, 0): size, (2, 1): size}) for n, size in enumerate((0.0, 0.0, 0.0, 0.33, last))]
    equations = equations_of(drives, (0,) * 5)
    (_, best), *_ = further(equations, equations.fit(()), places_of(equations), [WEAR])
    assert (best.course.kind, best.course.first) == (kind, 3)
