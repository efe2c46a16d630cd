"""Sentences about effects: nouns of the user's machine, and numbers with as many digits as are known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.mismatch.answer import CalibratedParameter, Parameter, Unexplained
from regolithd.calibration.mismatch.candidates.cold_lubricant_friction import ColdLubricantFriction
from regolithd.calibration.mismatch.candidates.coulomb_friction import CoulombFriction
from regolithd.calibration.mismatch.candidates.load_dependent_efficiency import LoadDependentEfficiency
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay
from regolithd.calibration.mismatch.inference.statements import (
    beyond_prior_in_words,
    notes_beside_priors,
    notes_on_priors,
    noun_of,
    on_wheels,
    parameters_found,
    plural,
    size_and_cost,
    statement,
    told,
    what_it_follows,
    words_of,
)
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Shape


@pytest.mark.parametrize(
    ("noun", "expected"),
    [
        ("wheel", "wheels"),
        ("axis", "axes"),
        ("body", "bodies"),
        ("bay", "bays"),
        ("box", "boxes"),
        ("branch", "branches"),
        ("bench", "benches"),
        ("bus", "buses"),
        ("drum side", "drum sides"),
        ("Axis", "Axes"),
        ("axes", "axes"),
        ("achse", "achse"),
        ("Prüfstand", "Prüfstand"),
    ],
)
def test_a_plural_is_that_of_the_noun(noun: str, expected: str) -> None:
    """English endings of what machines are made of; what is no such word stays as it is."""
    assert plural(noun) == expected


@pytest.mark.parametrize(
    ("column", "noun"), [("zone", "zone"), ("zone_id", "zone"), ("motor_no", "motor"), ("drum_side", "drum side")]
)
def test_a_column_s_name_is_a_noun(column: str, noun: str) -> None:
    """What says that it is a number or a name is left out."""
    assert noun_of(column) == noun


def test_the_axes_are_named_only_where_there_are_several() -> None:
    """One alone needs no name; a pair is both."""
    assert on_wheels((1,), 1, "pump") == ""
    assert on_wheels(("left", "right"), 2, "track_id") == ", on both tracks"
    assert on_wheels((1, 3), 4, "zone") == ", on zones 1 and 3"
    assert on_wheels((1, 2), 2, "achse") == ", on each achse"
    assert on_wheels((1, 3), 4, "achse") == ", on achse 1 and 3"
    assert on_wheels(("row1", "row2"), 4, "row") == ", on row1 and row2"


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        ((14.04, 13.98, 14.31), ("14.0", "14.0", "14.3")),
        ((436.0, 251.0, 560.0), ("436", "251", "560")),
        ((4.0, float("nan"), float("nan")), ("4", "nan", "nan")),
        ((7.0, 7.0, 7.0), ("7", "7", "7")),
    ],
)
def test_a_value_has_the_decimals_of_its_interval(
    interval: tuple[float, float, float], expected: tuple[str, str, str]
) -> None:
    """Both ends of a narrow interval differ as they are told."""
    assert told(*interval) == expected


def test_a_small_effect_has_a_decimal() -> None:
    """Else its interval would be told as a point."""
    parameters = {"relative_size": Parameter(0.039, 0.037, 0.041, "1")}
    sentence = statement("inertia of the parts that move", (1,), 1, parameters, (1.1, 1.0), "drum")
    assert sentence.startswith("Inertia of the parts that move: 3.9 % of the mean reading (90 % sure: 3.7 to 4.1 %); ")


def test_a_law_with_several_forms_tells_which_was_found() -> None:
    """In brackets after what it is, in the machine's own words; a law with one form has none."""
    labels = {"temperature": "oil temperature (°C)"}
    cold: Shape = {"power": 1.0, "no_drag_above_degC": 30.0}
    assert words_of(SensorDelay(), {"late": "torque_Nm", "filter_s": 0.2}, {}, {}) == (
        "a delay of torque_Nm (first-order filter)"
    )
    assert (
        words_of(ColdLubricantFriction(), cold, {}, labels) == "drag that grows as the oil temperature falls (a line)"
    )
    assert words_of(CoulombFriction(), {}, {}, {}) == CoulombFriction.words


@pytest.mark.parametrize(
    ("shape", "value", "begins"),
    [
        ({"power": 1.0}, 0.1, "a loss that depends on the transmitted torque ("),
        ({"power": 1.0}, -0.1, "less than is predicted, by a share that depends on the transmitted torque (power"),
        ({"bent": -0.1}, -0.1, "an efficiency that rises with the transmitted torque (linear"),
    ],
)
def test_a_loss_below_zero_is_none(shape: Shape, value: float, begins: str) -> None:
    """The machine needs less than predicted; of the linear efficiency it is a rise with the torque."""
    loss = {"relative_loss": Parameter(value, value - 0.01, value + 0.01, "1")}
    assert words_of(LoadDependentEfficiency(), shape, loss, {}).startswith(begins)


def test_a_parameter_beyond_its_prior_is_told_once() -> None:
    """With its unit, if it has one; a channel's note about it is no other note."""
    loss = CalibratedParameter("loss", "W/K", 4.0, 0.16, 4.97, 4.9, 5.0)
    gain = CalibratedParameter("gain", "1", 1.0, 0.1, 1.5, 1.4, 1.6)
    told = beyond_prior_in_words(loss)
    assert told.startswith("loss had to leave its prior: 4.97 W/K instead of 4 ± 0.16, 6.1 standard deviations away. ")
    assert "prior: 1.5 instead of 1 ± 0.1, " in beyond_prior_in_words(gain)
    notes = ["It rained.", f"level_m: {told}", beyond_prior_in_words(gain)]
    assert notes_beside_priors(notes, [loss]) == ["It rained.", notes[2]]
    assert notes_beside_priors(notes, []) == notes


def moved_by(stds: float) -> CalibratedParameter:
    """Return an outlet that is so many deviations of its prior away."""
    return CalibratedParameter("outlet", "m", 40.0, 2.0, 40.0 + 2 * stds, 39.0 + 2 * stds, 41.0 + 2 * stds)


def test_a_parameter_that_its_prior_holds_back_is_told_with_what_the_readings_alone_say() -> None:
    """Where a value stated rightly is seldom so far away; not beside what stays unexplained, nor of an exact one."""
    held = CalibratedParameter("rake_A", "A/t", 1.0, 0.1, 1.28, 1.28 - 0.5 * 0.1645, 1.28 + 0.5 * 0.1645)
    (note,) = notes_on_priors([held, moved_by(2.5)], unexplained=False)
    assert note.startswith("rake_A is 2.8 standard deviations from its stated value")
    # A quarter of the prior's variance is left, so that the readings alone have it a third further away.
    assert "by the readings alone it is 1.373 A/t (90 % sure: 1.278 to 1.468)" in note
    assert notes_on_priors([held], unexplained=True) == []
    assert notes_on_priors([replace(held, prior_std=0.0)], unexplained=False) == []


def test_a_cost_that_would_be_told_as_nothing_is_told_as_less_than_what_is_told() -> None:
    """Where parameters take an effect up, the held-out error hardly grows without it."""
    size = Parameter(0.05, 0.04, 0.06, "1")
    assert size_and_cost(size, (1.0002, 1.0)).endswith("the held-out error there less than 0.1 % larger")
    assert size_and_cost(size, (1.002, 1.0)).endswith("the held-out error there 0.2 % larger")


def test_beside_something_unexplained_only_a_clear_distance_from_the_prior_is_a_finding() -> None:
    """Less is told in a note, as what may stand for a part of the unknown; alone it is a finding."""
    inside, beyond, clear = moved_by(2.5), moved_by(3.2), moved_by(6.5)
    parameters = [inside, beyond, clear]
    assert parameters_found(parameters, unexplained=False) == [beyond, clear]
    assert parameters_found(parameters, unexplained=True) == [clear]
    assert [note.split(" ", 1)[0] for note in notes_on_priors(parameters, unexplained=False)] == ["outlet", "outlet"]
    about, found = notes_on_priors([beyond, clear], unexplained=True)
    assert about == (
        "Beside what stays unexplained outlet is 3.2 standard deviations from its prior. It may stand for a part of "
        "that: this is no finding."
    )
    assert found.startswith("outlet had to leave its prior")
    assert notes_beside_priors([about, found, "a gap"], [beyond]) == ["a gap"]


def unexplained_over(value: tuple[float, ...], coupling: str) -> Unexplained:
    """Return something unexplained over the wind, with this curve."""
    low, high = tuple(each - 0.02 for each in value), tuple(each + 0.02 for each in value)
    curve = EmpiricalCurve(coupling, False, "1", "m/s", (1.0, 5.0, 9.0), value, low, high, 2.0, 1.0)
    return Unexplained("power_W", ("east",), "wind", 0.0, 9.0, 0.8, curve=curve)


@pytest.mark.parametrize(
    ("value", "coupling", "told"),
    [
        ((-0.12, -0.121, -0.119), "gain", "is a constant share of the prediction that hardly depends on the wind"),
        ((0.5, 0.51, 0.49), "offset", "is a constant that hardly depends on the wind"),
        ((0.5, 0.51, 0.49), "drag", "is a constant along the motion that hardly depends on the wind"),
        ((0.5, 0.7, 0.49), "offset", "follows the wind"),
        ((0.3, 0.0, -0.3), "offset", "follows the wind"),
    ],
)
def test_a_curve_that_hardly_varies_is_told_as_a_constant(value: tuple[float, ...], coupling: str, told: str) -> None:
    """A constant is found over whichever covariate chance picks: the sentence does not say that it depends on that."""
    assert what_it_follows(unexplained_over(value, coupling), "the wind") == told
