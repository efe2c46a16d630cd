"""The choice of a fleet's effects: what is concealed is named with its rovers, wheels and dates, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic_fleet import DRAG, GROUPS, WAVE, WEAR, drive, equations_of, on_both, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations, fleet_equations
from regolithd.calibration.mismatch.fleet.choice.search import further, places_of
from regolithd.calibration.mismatch.fleet.choice.selection import (
    Chooser,
    folds_of,
    relative_size,
    told_by_others,
    without,
)
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units
from regolithd.calibration.mismatch.regression.residuals import active_rms

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from synthetic_fleet import Drive

ROVER = (0, 1) * 5
ENTRY = 8.0


def equations(concealed: Mapping[int, Mapping[tuple[int, int], float]]) -> FleetEquations:
    """Return two rovers with five recordings each, which take turns, and effects in some of them."""
    return equations_of([drive(100 + n, concealed.get(n)) for n in range(10)], ROVER)


def chooser(of: FleetEquations) -> Chooser:
    """Return the choice with a fixed threshold."""
    return Chooser(of, places_of(of), ENTRY)


def told(terms: Sequence[FleetTerm]) -> list[tuple[object, ...]]:
    """Return name, rovers, wheels and course of terms."""
    return sorted(
        (t.name, t.units.sharing, t.units.rovers, t.units.wheels, t.course.kind, t.course.first) for t in terms
    )


def test_nothing_is_named_where_nothing_is_concealed() -> None:
    """Noise gains less than is asked for."""
    assert chooser(equations({})).chosen().terms == ()


def test_effects_have_their_rovers_wheels_and_dates() -> None:
    """One of the fleet, one of a rover since a date, and the wear of one wheel."""
    of_all = dict(on_both(3, 0.1))
    both = {n: of_all | (on_both(1, 0.12) if n in {4, 6, 8} else {}) for n in range(10)}
    worn = {n: both[n] | ({(2, 1): 0.15} if n in {5, 7, 9} else {}) for n in range(10)}
    assert told(chooser(equations(worn)).chosen().terms) == [
        ("steady-drag", "all", (0,), (0, 1), "since", 4),
        ("wave", "all", (0, 1), (0, 1), "always", 0),
        ("wear", "one", (1,), (1,), "since", 5),
    ]


def test_a_date_of_a_rover_that_does_not_show_it_is_of_the_next_that_does() -> None:
    """What was found on both rovers, since a recording of the second, is searched anew on the first alone."""
    of = equations({n: on_both(1, 0.12) for n in (6, 8)})
    both = FleetTerm(DRAG, Units((0, 1), (0, 1)), Course("since", 5))
    one = chooser(of)._on_fewer_rovers(of.fit([both]), 0)
    assert {(each.units.rovers, each.course) for each in one} == {((0,), Course("since", 6))}
    assert told(chooser(of).chosen().terms) == [("steady-drag", "all", (0,), (0, 1), "since", 6)]


def test_a_size_of_each_rover_s_own_is_told_from_one_size() -> None:
    """Where rovers differ by more than the noise, each has its own."""
    of = equations({n: on_both(1, 0.2 if n % 2 else 0.3) for n in range(10)})
    (one,) = chooser(of).chosen().terms
    assert (one.name, one.units.rovers, one.units.each, one.course.kind) == ("steady-drag", (0, 1), True, "always")


def test_each_rover_must_show_an_effect_of_its_own_size() -> None:
    """A size that is nothing beside its error is none, although the other rover's is large."""
    of = equations({n: on_both(1, 0.3) for n in range(0, 10, 2)})
    each = FleetTerm(DRAG, Units((0, 1), (0, 1), each=True), Course("always"))
    assert not chooser(of).acceptable(of.fit((each,)))
    assert chooser(of).acceptable(of.fit((term(DRAG, Course("always")),)))


def test_an_effect_of_some_rovers_is_on_those_alone() -> None:
    """Over all of a fleet it gains more than on any single rover, and the others' parameters would pay for it."""
    rovers = tuple(n % 4 for n in range(16))
    drives = [drive(100 + n, on_both(1, 0.2) if n % 4 < 2 else {}) for n in range(16)]
    of = equations_of(drives, rovers)
    found = chooser(of).chosen().terms
    assert {(one.name, rover) for one in found for rover in one.units.rovers} == {
        ("steady-drag", 0),
        ("steady-drag", 1),
    }


def three_drags(drives: Sequence[Drive]) -> FleetEquations:
    """Return the equations of recordings in which a first law is nearly the sum of two others, which may act."""
    for each in drives:
        each.columns[1] = each.columns[2] + each.columns[3] + 0.3 * each.columns[1]
    names = ("steady-drag", "one-drag", "other-drag")
    candidates = [type("Named", (type(DRAG.candidate),), {"name": name})() for name in names]
    groups = [replace(DRAG, candidate=each, columns=(1 + k,)) for k, each in enumerate(candidates)]
    sums = [replace(each.sums(), places=((1,), (2,), (3,))) for each in drives]
    of = fleet_equations(sums, ROVER, range(10), groups, "rover")
    assert further(of, of.fit(()), places_of(of))[0][1].name == "steady-drag"
    return of


def test_a_change_of_two_rovers_of_three_is_one_effect() -> None:
    """One of them has a single recording since, which no other could confirm; of three rovers no pairs are searched."""
    worn = {n: {(2, 1): 0.3} for n in (11, 12, 14)}
    of = equations_of([drive(200 + n, worn.get(n)) for n in range(15)], (0, 1, 2) * 5)
    assert told(chooser(of).chosen().terms) == [("wear", "one", (0, 2), (1,), "since", 11)]


def test_of_different_laws_on_two_rovers_none_is_on_both() -> None:
    """A third law that is a little of both gains most over all of the fleet."""
    drives = [drive(100 + n, on_both(2, 0.2 - 0.06 * (n % 2)) | on_both(3, 0.2 * (n % 2))) for n in range(10)]
    for each in drives:
        each.columns[3] += 0.7 * each.columns[2]
    found = chooser(three_drags(drives)).chosen().terms
    assert {(one.name, one.units.rovers) for one in found} == {("one-drag", (0,)), ("other-drag", (1,))}


def test_of_two_laws_that_act_everywhere_none_is_the_third() -> None:
    """A law that is a little of both gains most by itself, and leaves less than a law's share for either of them."""
    drives = [drive(100 + n, on_both(2, 0.2) | on_both(3, 0.2)) for n in range(10)]
    found = chooser(three_drags(drives)).chosen().terms
    assert {(one.name, one.units.rovers) for one in found} == {("one-drag", (0, 1)), ("other-drag", (0, 1))}


def test_a_law_with_which_a_search_begins_may_be_none() -> None:
    """What gains too little beside the laws that were chosen after it is left out again."""
    drives = [drive(100 + n, on_both(2, 0.2) | on_both(3, 0.2)) for n in range(10)]
    of = three_drags(drives)
    third, one, other = (term(group, Course("always"), rovers=(0, 1)) for group in of.groups)
    left = chooser(of)._that_gain_enough(of.fit((third, one, other)))
    assert {each.name for each in left.terms} == {"one-drag", "other-drag"}


def test_an_effect_may_be_on_one_wheel_of_all_rovers() -> None:
    """One term, of one size."""
    of = equations({n: {(1, 0): 0.2} for n in range(10)})
    (one,) = chooser(of).chosen().terms
    assert (one.name, one.units.rovers, one.units.wheels, one.units.each) == ("steady-drag", (0, 1), (0,), False)


def test_what_a_prior_alone_pays_need_not_come_back() -> None:
    """A parameter that acts as the effect does takes nearly all of it up in recordings that did not fit it."""
    drives = [drive(100 + n, on_both(1, 0.2)) for n in range(10)]
    for each in drives:
        each.columns[0] = each.columns[1] + 0.01 * each.columns[0]
    sums = [replace(each.sums(), prior_stds=np.array([0.02])) for each in drives]
    of = fleet_equations(sums, ROVER, range(10), GROUPS, "rover")
    assert {one.name for one in chooser(of).chosen().terms} == {"steady-drag"}


def test_an_effect_too_small_to_matter_is_not_acceptable() -> None:
    """Below a fiftieth of the mean reading, however certain it is."""
    concealed = {n: on_both(1, 0.1) for n in range(10)}
    drives = [drive(100 + n, concealed[n]) for n in range(10)]
    for mean_size, acceptable in ((4.0, True), (6.0, False)):
        of = fleet_equations([each.sums(mean_size) for each in drives], ROVER, range(10), GROUPS, "rover")
        fit = of.fit((term(DRAG, Course("always")),))
        assert relative_size(of, fit, 0) == pytest.approx(0.1 / mean_size, rel=0.1)
        assert chooser(of).acceptable(fit) == acceptable


def test_an_effect_of_the_wrong_sign_is_not_acceptable() -> None:
    """A drag does not push; each coefficient of a wave may have either sign."""
    of = equations({n: {**on_both(1, -0.2), **on_both(3, -0.2), **on_both(4, 0.2)} for n in range(10)})
    assert not chooser(of).acceptable(of.fit((term(DRAG, Course("always")),)))
    assert chooser(of).acceptable(of.fit((term(WAVE, Course("always")),)))


def test_the_size_is_the_root_mean_square_while_the_effect_acts() -> None:
    """Of one column, computed from the readings; of several, their root mean square."""
    drives = [drive(n, on_both(1, 0.2)) for n in range(4)]
    of = fleet_equations([each.sums(mean_size=2.0) for each in drives], (0,) * 4, range(4), GROUPS, "rover")
    fit = of.fit((term(DRAG, Course("since", 1), wheels=(1,)), term(WAVE, Course("always"))))
    size = fit.coefficients[fit.spans[0]][0]
    acting = size * np.concatenate([drives[i].columns[1, :, 1] for i in (1, 2, 3)])
    assert relative_size(of, fit, 0) == pytest.approx(active_rms(acting**2, 0.4) / 2.0)
    sine, cosine = fit.coefficients[fit.spans[1]]
    waves = np.array([sine * each.columns[3] + cosine * each.columns[4] for each in drives])
    assert relative_size(of, fit, 1) == pytest.approx(np.sqrt(np.mean(waves**2)) / 2.0)


def test_an_intermittent_effect_counts_as_large_as_it_is_while_it_acts() -> None:
    """At least two fifths of its root mean square there; as large as it is over all readings, where it is told."""
    quiet = drive(3)
    columns = quiet.columns.copy()
    columns[1, 6:] = 0.0
    rare = replace(quiet, columns=columns, residual=quiet.residual + columns[1])
    of = fleet_equations([rare.sums()], (0,), (0.0,), GROUPS, "rover")
    fit = of.fit((term(DRAG, Course("always")),))
    acting = fit.coefficients[fit.spans[0]][0] * columns[1]
    assert relative_size(of, fit, 0) == pytest.approx(active_rms(acting.ravel() ** 2, 0.4))
    assert relative_size(of, fit, 0) > 1.5 * np.sqrt(np.mean(acting**2))
    assert relative_size(of, fit, 0, active_share=0.0) == pytest.approx(np.sqrt(np.mean(acting**2)))


def test_an_effect_of_one_recording_is_not_confirmed_by_the_others() -> None:
    """What gains enough only through one of five recordings is none of the rover."""
    of = equations({2: on_both(1, 1.0), **{n: on_both(4, 0.1) for n in range(0, 10, 2)}})
    of_one, of_all = term(DRAG, Course("always")), term(WAVE, Course("always"))
    found = chooser(of).confirmed(of.fit((of_one, of_all)))
    assert found.terms == (of_all,)
    assert found.delta_chi2 == pytest.approx(of.fit((of_all,)).delta_chi2)


def test_a_recording_that_alone_tells_another_effect_s_size_is_not_asked() -> None:
    """Without that size, what is left there is that effect, and not what the recordings before predict."""
    drives = [drive(100 + n, on_both(4, 0.15) | on_both(1, 2.0 if n == 3 else 0.0)) for n in range(4)]
    drives[3].columns[4] -= 0.7 * drives[3].columns[1]
    of = equations_of(drives, (0,) * 4)
    terms = (term(DRAG, Course("since", 3)), term(WAVE, Course("always")))
    assert told_by_others(of, terms).tolist() == [True, True, True, False]
    assert told_by_others(of, terms[1:]).all()
    assert told_by_others(of, ()).all()
    assert chooser(of)._transfer_margin(of.fit(terms), 1) > 0


def test_a_size_of_a_rover_s_own_pays_for_the_choice_among_rovers() -> None:
    """What passes on the only rover is no certain size on one of four."""
    each = FleetTerm(DRAG, Units((0,), (0, 1), each=True), Course("always"))
    for count in (1, 4):
        of = equations_of([drive(100 + n, on_both(1, 0.2 * (n == 0))) for n in range(4)], [n % count for n in range(4)])
        fit = of.fit((each,))
        gained = float(fit.coefficients[fit.spans[0]][0] ** 2 / np.diag(fit.covariance)[fit.spans[0]][0])
        needed = gained - 2 * np.log(count)
        for entry, certain in ((needed - 0.1, True), (needed + 0.1, False)):
            assert replace(chooser(of), entry_threshold=entry)._certain(fit, 0).all() == certain


def test_two_recordings_cannot_confirm_an_effect_and_three_can() -> None:
    """Of two, either would have to be predicted by the other alone."""
    for count, kept in ((2, 1), (3, 0)):
        concealed: list[dict[tuple[int, int], float]] = [{}] * (count - 1) + [on_both(1, 1.0)]
        of = equations_of([drive(n, each) for n, each in enumerate(concealed)], (0,) * count)
        assert len(chooser(of).confirmed(of.fit((term(DRAG, Course("always")),))).terms) == kept


def test_an_effect_is_searched_anew_beside_a_later_one() -> None:
    """One that was taken for the fleet's belongs to the rover that has it, once that fits better."""
    of = equations({n: on_both(1, 0.3) for n in range(0, 10, 2)})
    taken = of.fit((term(DRAG, Course("always"), rovers=(0, 1)),))
    assert told(chooser(of).searched_anew(taken, places_of(of)).terms) == [
        ("steady-drag", "all", (0,), (0, 1), "always", 0)
    ]


def test_what_cannot_be_improved_stays() -> None:
    """Only a better score replaces an effect."""
    of = equations({n: on_both(1, 0.3) for n in range(0, 10, 2)})
    fit = of.fit((term(DRAG, Course("always")), term(WEAR, Course("since", 4), wheels=(0,))))
    assert chooser(of).searched_anew(of.fit(fit.terms[:1]), places_of(of)).terms == fit.terms[:1]
    assert without(fit, 0) == fit.terms[1:]
    assert without(fit, 1) == fit.terms[:1]


def test_a_further_effect_must_gain_a_share_of_the_others_on_its_rovers() -> None:
    """A few hundredths of a large effect's Δχ² may be the error of its shape; effects of other rovers do not count."""
    of = equations({n: {**on_both(1, 4.0), **on_both(3, 0.1)} if n % 2 == 0 else on_both(3, 0.1) for n in range(10)})
    large = of.fit((term(DRAG, Course("always")),))
    beside, elsewhere = (of.fit((*large.terms, term(WAVE, Course("always"), rovers=(n,)))) for n in (0, 1))
    gained = beside.delta_chi2 - large.delta_chi2
    assert 10 * ENTRY < gained < 0.01 * large.delta_chi2
    assert not chooser(of).worthwhile(large, beside)
    assert chooser(of).worthwhile(large, elsewhere)


def test_every_fifth_recording_of_a_rover_is_in_the_same_fold() -> None:
    """Each recording is in one fold; the first of each rover is in another than that of the rover before."""
    folds = folds_of(equations_of([drive(n) for n in range(7)], (0, 0, 0, 0, 0, 0, 1)))
    assert [np.flatnonzero(fold).tolist() for fold in folds] == [[0, 5], [1, 6], [2], [3], [4]]
    np.testing.assert_array_equal(np.sum(folds, axis=0), np.ones(7))


def test_a_law_has_one_shape_on_a_wheel_and_may_have_another_size_since_a_date() -> None:
    """A second shape on the same wheels mends the first; on another rover or wheel it is that one's own."""
    steeper = replace(DRAG, shape={"power": 2.0}, columns=(3,))
    of = equations({n: {**on_both(1, 0.4), **on_both(3, 0.2)} for n in range(10)})
    always, since = Course("always"), Course("since", 4)
    first = term(DRAG, always)
    assert not chooser(of).acceptable(of.fit((first, term(steeper, always))))
    assert not chooser(of).acceptable(of.fit((first, term(steeper, always, wheels=(1,)))))
    assert chooser(of).acceptable(of.fit((first, term(steeper, always, rovers=(1,)))))
    grown = equations({n: on_both(1, 0.2 if n < 4 else 0.4) for n in range(10)})
    assert chooser(grown).acceptable(grown.fit((first, term(DRAG, since))))
