"""What single recordings show beside the effects of the fleet."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sample_answer import FINDINGS
from synthetic_fleet import DEVIATION, DRAG, GROUPS, PRIOR_STD, WAVE, Drive, drive, on_both, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.recordings import gain_beside, shown_beside
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations

OWN = 4
"""The column that recordings show by themselves here: the second of the wave's."""


def with_own(each: Drive, count: int = 1, last: Drive | None = None) -> FleetEquations:
    """Return equations of three recordings, of which the second shows `count` terms of its own, each by one column."""
    places = tuple((OWN - k,) for k in range(count))
    sums = [drive(0).sums(), replace(each.sums(), own=places), (last or drive(2)).sums()]
    return fleet_equations(sums, (0,) * 3, (0.0, 1.0, 2.0), GROUPS, "rover")


def found(*terms: FoundTerm) -> Found:
    """Return what a recording was found to show."""
    return Found(FINDINGS, {}, DEVIATION, 1.0, 0.1, 10.0, terms, {})


def shown(name: str, *, named: bool, penalty: float = 2.0) -> FoundTerm:
    """Return a term of one recording."""
    return FoundTerm(name, named, {}, (0, 1), penalty, np.zeros((1, 1, 2), np.float32))


def test_what_a_recording_gains_is_beside_its_parameters_and_the_fleet_s_effects() -> None:
    """As least squares of its readings has it, with the parameters held by their priors about the fleet's."""
    one = drive(1, {**on_both(1, 0.2), **on_both(OWN, 0.1), (0, 0): 0.1, (0, 1): 0.1})
    of = with_own(one)
    fit = of.fit((term(DRAG, Course("since", 1)),))
    rest = one.residual.copy()
    for at, factor, value in zip(fit.columns, fit.factors[:, 1, 0], fit.coefficients, strict=True):
        rest -= value * factor * one.columns[at]
    right = np.append((rest / DEVIATION).ravel(), 0.0)
    squares = []
    for columns in ((0,), (0, OWN)):
        prior = np.zeros((1, len(columns)))
        prior[0, 0] = 1 / PRIOR_STD
        matrix = np.concatenate([(one.columns[list(columns)] / DEVIATION).reshape(len(columns), -1).T, prior])
        squares.append(float(np.linalg.lstsq(matrix, right, rcond=None)[1][0]))
    assert gain_beside(of, fit, 1, 0) == pytest.approx(squares[0] - squares[1])


def test_what_the_fleet_s_effects_explain_is_not_gained_again() -> None:
    """The recording's own finding is then the fleet's."""
    one = drive(1, on_both(OWN, 0.2))
    of = with_own(one, last=drive(2, on_both(OWN, 0.2)))
    alone = gain_beside(of, of.fit(()), 1, 0)
    explained = gain_beside(of, of.fit((term(WAVE, Course("since", 1)),)), 1, 0)
    assert explained < 0.05 * alone


def test_a_recording_without_free_parameters_or_readings_of_its_term_gains_what_is_there() -> None:
    """A column of zeros gains nothing."""
    one = drive(1, on_both(OWN, 0.2))
    sums = replace(one.sums(), own=((OWN,), (1,)), tangents=(), prior_stds=np.zeros(0))
    gram, moment = sums.gram.copy(), sums.moment.copy()
    gram[:, 1], gram[:, :, 1], moment[:, 1] = 0.0, 0.0, 0.0
    groups = [replace(group, columns=tuple(column - 1 for column in group.columns)) for group in GROUPS]
    of = fleet_equations([replace(sums, gram=gram, moment=moment)], (0,), (0.0,), groups, "rover")
    column, rest = one.columns[OWN] / DEVIATION, one.residual / DEVIATION
    expected = np.sum(column * rest) ** 2 / np.sum(column**2)
    assert gain_beside(of, of.fit(()), 0, 0) == pytest.approx(expected)
    assert gain_beside(of, of.fit(()), 0, 1) == 0.0


@pytest.mark.parametrize("margin", [-0.01, 0.01])
def test_a_finding_must_gain_what_was_asked_there_and_for_the_choice_among_recordings(margin: float) -> None:
    """Threshold and penalty of the recording's own comparison, and 2 ln of the number of recordings."""
    of = with_own(drive(1, on_both(OWN, 0.1)))
    fit = of.fit(())
    asked = gain_beside(of, fit, 1, 0) - 2 * np.log(3) - margin
    named = shown("viscous-friction", named=True, penalty=asked - 10.0)
    curve = shown("voltage", named=False, penalty=asked - THRESHOLDS.smooth_term_entry)
    for of_recording, part in ((named, "effects"), (curve, "unexplained")):
        result = shown_beside(of, fit, [found(), found(of_recording), found()])
        assert len(getattr(result, part)) == (margin > 0)


def test_a_fault_of_another_channel_has_to_show_in_the_predicted_one() -> None:
    """A load cell that seems to drift gains nothing beside the drag that the fleet has there."""
    drift = shown("load-cell-drift", named=True, penalty=-250.0)
    of = with_own(drive(1, on_both(OWN, 0.2)))
    assert shown_beside(of, of.fit(()), [found(), found(drift), found()]).terms == ((1, 0),)
    quiet = with_own(drive(1))
    assert shown_beside(quiet, quiet.fit(()), [found(), found(drift), found()]).terms == ()


def test_a_finding_is_told_as_its_recording_tells_it() -> None:
    """With the place of the recording; a name by its name, a structure by its place among the structures."""
    of = with_own(drive(1, {**on_both(OWN, 0.2), **on_both(OWN - 1, 0.2)}), count=2)
    fit = of.fit(())
    of_recording = found(shown("viscous-friction", named=True), shown("voltage", named=False))
    result = shown_beside(of, fit, [found(), of_recording, found()])
    assert result.effects == ((1, FINDINGS.effects[1]),)
    assert result.unexplained == ((1, FINDINGS.unexplained[0]),)
    assert result.terms == ((1, 0), (1, 1))


def test_what_the_fleet_has_is_not_told_again_of_a_recording() -> None:
    """Not where it acts; before its date it is the recording's own."""
    of = with_own(drive(1, {**on_both(OWN, 0.2), **on_both(1, 0.3)}))
    own = found(shown("steady-drag", named=True))
    for first, told in ((1, ()), (2, ((1, 0),))):
        fit = of.fit((term(DRAG, Course("since", first)),))
        assert shown_beside(of, fit, [found(), own, found()]).terms == told


@pytest.mark.parametrize(
    ("rover", "coupling", "told"),
    [((0, 0, 0), "drag", ((0, 0), (1, 0))), ((0, 1, 0), "drag", ()), ((0, 0, 0), "offset", ())],
)
def test_the_same_curve_in_several_recordings_of_a_rover_is_judged_together(
    rover: tuple[int, ...], coupling: str, told: tuple[tuple[int, int], ...]
) -> None:
    """Its cost is paid in each, the threshold once; a recording that does not pay its cost is not of it."""
    sums = [replace(drive(n, on_both(OWN, 0.1)).sums(), own=((OWN,),)) for n in range(3)]
    of = fleet_equations(sums, rover, (0.0, 1.0, 2.0), GROUPS, "rover")
    fit, needed = of.fit(()), THRESHOLDS.smooth_term_entry + 2 * np.log(3)
    gains = [gain_beside(of, fit, n, 0) for n in range(3)]
    costs = [gains[0] - 0.6 * needed, gains[1] - 0.6 * needed, gains[2] + 1.0]
    couplings = ("drag", coupling, "drag")
    terms = [replace(shown("voltage", named=False, penalty=costs[n]), coupling=couplings[n]) for n in range(3)]
    assert shown_beside(of, fit, [found(each) for each in terms]).curves == told


@pytest.mark.parametrize("margin", [-0.01, 0.01])
@pytest.mark.parametrize("named", [True, False])
def test_the_recording_s_own_lead_pays_for_the_choice_among_recordings(named: bool, margin: float) -> None:
    """However much it gains beside the fleet: the recording's own answer knows how slow its noise is."""
    of = with_own(drive(1, on_both(OWN, 0.2)))
    lead = 2 * float(np.log(3)) + margin
    one = replace(shown("viscous-friction" if named else "load", named=named), lead=lead)
    assert bool(shown_beside(of, of.fit(()), [found(), found(one), found()]).terms) == (margin > 0)


def test_leads_of_the_same_curve_add_up() -> None:
    """Of two recordings of one rover; each alone is behind."""
    both = [drive(n, on_both(OWN, 0.2)) for n in (1, 2)]
    sums = [drive(0).sums(), *(replace(each.sums(), own=((OWN,),)) for each in both)]
    of = fleet_equations(sums, (0,) * 3, (0.0, 1.0, 2.0), GROUPS, "rover")
    curve = replace(shown("load", named=False), lead=1.2)
    assert shown_beside(of, of.fit(()), [found(), found(curve), found(curve)]).curves == ((1, 0), (2, 0))
    assert not shown_beside(of, of.fit(()), [found(), found(curve), found(replace(curve, lead=0.9))]).curves
