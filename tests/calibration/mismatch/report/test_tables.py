"""The report's tables about the whole answer, its headline, and what it shows of several channels."""

from __future__ import annotations

from dataclasses import replace

import pytest
from sample_answer import ANSWER, CONSISTENT, FROM, VISCOUS, evidence

from regolithd.calibration.mismatch.answer import CalibratedParameter, Change, FitImprovement, Indistinguishable
from regolithd.calibration.mismatch.problem.problem import LeftOut
from regolithd.calibration.mismatch.report import tables
from regolithd.calibration.mismatch.report.labels import Labels, verdict_sentence
from regolithd.calibration.mismatch.report.page import render_report
from regolithd.calibration.mismatch.report.sections import confusions

MASS = CalibratedParameter("mass_kg", "kg", 50.0, 2.0, 90.5, 89.0, 92.0)
EXACT = CalibratedParameter("radius_m", "m", 0.075, 0.0, 0.075, 0.075, 0.075)
MORE = Change("coulomb-friction", "coulomb_current", 0.62, 0.91, 0.88, 0.94, "A", "motor_current_A", (2, 4))
GONE = Change("coulomb-friction", "coulomb_current", 0.62, 0.01, -0.01, 0.03)
CHANGED = replace(CONSISTENT, verdict="missing-physics", changes=(MORE,), parameters=(MASS, EXACT))


def test_the_headline_tells_changes_and_parameters_that_left_their_priors() -> None:
    """Also where no effect is named."""
    assert verdict_sentence(CHANGED) == (
        "Coulomb friction is larger than it was. The parameter mass_kg had to leave its prior."
    )
    assert verdict_sentence(replace(CHANGED, changes=(GONE,), parameters=())) == "Coulomb friction is gone."


def test_a_parameter_s_row_has_what_was_stated_and_what_came_out() -> None:
    """An exact parameter has no interval."""
    moved, exact = tables.calibrated(CHANGED)
    assert (moved.stated, moved.value, moved.low, moved.high, moved.unit) == ("50 ± 2", "90.5", "89.0", "92.0", "kg")
    assert moved.beyond_prior
    assert (exact.stated, exact.low, exact.beyond_prior) == ("0.075 (exact)", "", False)


@pytest.mark.parametrize(("change", "direction"), [(MORE, "larger"), (GONE, "gone")])
def test_a_change_s_row_has_both_sizes(change: Change, direction: str) -> None:
    """What was corrected, and what it is now with its interval."""
    (row,) = tables.changes(replace(CHANGED, changes=(change,)), Labels())
    assert (row.label, row.direction, row.corrected) == ("Coulomb friction", direction, "0.62")


def test_a_change_s_row_has_its_wheels_and_unit() -> None:
    """Of several channels the channel too; small currents are in mA."""
    of_channels = replace(CHANGED, fits=(CHANGED.fit, CHANGED.fit))
    (alone,), (several,) = (tables.changes(each, Labels(in_milli=True), range(1, 7)) for each in (CHANGED, of_channels))
    assert (alone.where, alone.corrected, alone.now, alone.unit) == ("wheels 2, 4", "620", "910", "mA")
    assert several.where == "motor_current_A, wheels 2, 4"


def test_what_cannot_be_told_apart_is_told_as_found_or_not() -> None:
    """An effect that the simulation has already could only change."""
    sets = (
        Indistinguishable(("coulomb-friction", "viscous-friction"), "Drive."),
        Indistinguishable(("quadratic-drag", "rotor-inertia"), "Start.", beside=("rotor-inertia",)),
    )
    answer = replace(CHANGED, indistinguishable=sets)
    rows = confusions(answer, Labels(corrected=frozenset({"coulomb-friction", "quadratic-drag"})))
    assert [(row.effects, row.found) for row in rows] == [
        ("Coulomb friction (changed) and viscous friction", True),
        ("Quadratic drag (changed), or quadratic drag with rotor inertia beside it", False),
    ]


def test_the_page_shows_parameters_changes_and_what_is_left_out() -> None:
    """Each has its heading, and none of them is there without a row."""
    left_out = (LeftOut("motor_current_A", 1200, "pitch was not measured there"),)
    page = render_report(replace(CHANGED, left_out=left_out), evidence(1800.0), FROM)
    headings = ("Parameters of the simulation", "What has changed since", "Readings that are not compared")
    assert all(heading in page for heading in headings)
    assert "1,200" in page
    assert "left its prior" in page
    assert "with the effects added" in page
    plain = render_report(CONSISTENT, evidence(1800.0), FROM)
    assert not any(heading in plain for heading in (*headings, "with the effects added"))


def test_each_of_several_channels_has_its_own_drawings_and_findings() -> None:
    """An effect stands with its channel, in its channel's unit; a sensor's fault with the first."""
    thrust = replace(evidence(1800.0), channel="thrust_N", unit="N")
    both = replace(evidence(1800.0), others=(thrust,))
    pushing = replace(VISCOUS, name="quadratic-drag", channel="thrust_N", rmse_before=3.2, rmse_after=2.1)
    fits = (ANSWER.fit, FitImprovement("thrust_N", 3.3, 2.2, 2.0))
    answer = replace(ANSWER, effects=(*ANSWER.effects, pushing), fits=fits)
    page = render_report(answer, both, FROM)
    assert page.count("<h2>Where they differ") == 2
    first, second = page.split("<h2>Where they differ")[1:]
    assert "Bearing drag" in first
    assert "Quadratic drag" not in first.split("<h2>Parameters")[0].split("<h2>Effects that this")[0]
    assert "held-out error: 3.2 → 2.1 N" in second
    assert "thrust_N</td>" in page


def test_a_channel_in_which_something_was_found_comes_first() -> None:
    """Whatever the simulation's order is."""
    thrust = replace(evidence(1800.0), channel="thrust_N", unit="N")
    both = replace(evidence(1800.0), others=(thrust,))
    pushing = replace(VISCOUS, name="quadratic-drag", channel="thrust_N", rmse_before=3.2, rmse_after=2.1)
    fits = (ANSWER.fit, FitImprovement("thrust_N", 3.3, 2.2, 2.0))
    page = render_report(replace(ANSWER, effects=(pushing,), unexplained=(), fits=fits), both, FROM)
    first, second = page.split("<h2>Where they differ: <code>")[1:]
    assert (first.split("<")[0], second.split("<")[0]) == ("thrust_N", "motor_current_A")


def test_a_curve_that_changed_is_called_by_what_it_is_over() -> None:
    """In the words of the machine; the key that names it in the answer stands nowhere."""
    labels = Labels(covariates={"position": "leaf angle (rad)"})
    doubled = Change("empirical-drag-over-position", "factor", 1.0, 2.04, 1.9, 2.2)
    (row,) = tables.changes(replace(CHANGED, changes=(doubled,)), labels)
    assert (row.label, row.parameter) == ("Empirical curve over the leaf angle", "factor on the curve")
    assert (row.corrected, row.now, row.low, row.high) == ("1", "2.04", "1.90", "2.20")
