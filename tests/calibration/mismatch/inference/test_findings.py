"""What an answer says: verdict, effects, what stays unexplained, and the arrays behind it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, NOISE, Level, problem_of, table

from regolithd.calibration.mismatch import compare, from_columns
from regolithd.calibration.mismatch.answer import Indistinguishable
from regolithd.calibration.mismatch.inference.findings import one_way_only
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.result import Comparison


@pytest.fixture(scope="module")
def dragging() -> Comparison:
    """Return the comparison of a recording with a drag of 0.3 V."""
    return compare(from_columns(table(drag=0.3), unit="axis"), Level())


@pytest.fixture(scope="module")
def bumpy() -> Comparison:
    """Return the comparison of a recording with a bump over the speed in its second half, which nobody can name."""
    columns = table()
    bump = 0.8 * np.exp(-(((np.abs(columns["speed_rad_s"]) - 0.9) / 0.2) ** 2))
    return compare(from_columns({**columns, "reading_V": columns["reading_V"] + bump}, unit="axis"), Level())


def test_a_named_effect_has_its_place_size_and_errors(dragging: Comparison) -> None:
    """The verdict says that physics is missing."""
    answer = dragging.answer
    (effect,) = answer.effects
    assert answer.verdict == "missing-physics"
    assert (effect.name, effect.wheels, effect.channel, effect.covariate) == ("drag", (1, 2), "reading_V", "direction")
    assert effect.onset_s is None
    assert effect.parameters["drag"].value == pytest.approx(0.3, abs=0.02)
    assert effect.rmse_after == pytest.approx(NOISE, rel=0.05)
    assert effect.rmse_before > effect.rmse_after
    assert answer.fit.noise_floor_rmse == pytest.approx(NOISE, rel=0.05)
    assert effect.statement.startswith("A drag")


def test_what_has_no_name_is_unexplained_with_its_covariate(bumpy: Comparison) -> None:
    """Where it acts, from when to when, and its share of the residual; a shoulder is a small range of its own."""
    answer = bumpy.answer
    assert answer.verdict == "unexplained"
    rest, *shoulders = answer.unexplained
    assert all((each.covariate, each.share_of_residual < 0.02) == ("wheel_speed", True) for each in shoulders)
    assert (rest.covariate, rest.wheels) == ("wheel_speed", (1, 2))
    assert 0.3 < rest.share_of_residual <= 1
    assert 0 <= rest.from_s < 40
    assert 360 < rest.to_s <= (INSTANTS - 1) * 0.5


def test_nothing_missing_is_consistent() -> None:
    """With a smallest detectable size for each candidate, and no note."""
    answer = compare(from_columns(table(), unit="axis"), Level()).answer
    assert (answer.verdict, answer.effects, answer.unexplained, answer.notes) == ("consistent", (), (), ())
    assert [one.name for one in answer.sensitivity] == ["drag", "offset", "power", "step"]


def test_the_evidence_is_the_residual_before_and_after(dragging: Comparison) -> None:
    """Arrays of the recording's shape; block means fall from significant to noise."""
    evidence = dragging.evidence
    assert evidence.measured.shape == evidence.before.shape == evidence.after.shape == (INSTANTS, AXES)
    assert np.std(evidence.measured - evidence.after) == pytest.approx(NOISE, rel=0.05)
    assert np.std(evidence.measured - evidence.before) > 1.3 * NOISE
    assert evidence.map_before.shape == evidence.map_after.shape == (len(evidence.map_time_s), AXES)
    assert np.nanmean(np.abs(evidence.map_before)) > 3
    assert np.nanmean(np.abs(evidence.map_after)) < 1.5
    assert np.all(np.diff(evidence.map_time_s) > 0)
    assert evidence.values["level"] == pytest.approx(2.0, abs=0.02)
    (term,) = evidence.contributions
    assert term.coefficients[0] == pytest.approx(0.3, abs=0.02)
    assert term.wheels == (1, 2)


def test_curves_come_with_the_most_significant_first(dragging: Comparison) -> None:
    """The drag over the speed: 0.3 before, nothing after, in bins of equal numbers."""
    curves = dragging.evidence.curves
    (along,) = [c for c in curves if (c.covariate, c.coupling) == ("wheel_speed", "drag")]
    np.testing.assert_allclose(along.before, 0.3, atol=0.1)
    np.testing.assert_allclose(along.after, 0.0, atol=0.1)
    np.testing.assert_allclose(along.standard_error, NOISE / np.sqrt(INSTANTS * AXES / 24), rtol=0.2)
    ranks = [float(np.mean((c.before / c.standard_error) ** 2)) for c in curves]
    assert ranks == sorted(ranks, reverse=True)
    assert not {"wheel_angle", "wheel_acceleration"} & {c.covariate for c in curves}


def test_notes_say_what_could_not_be_compared_or_looked_for() -> None:
    """Outliers, silent axes, and candidates whose covariates are missing."""
    columns = table()
    columns["reading_V"][columns["axis"] == 2] = np.nan
    columns["reading_V"][100] = 50.0
    notes = compare(from_columns(columns, unit="axis"), WithLibrary()).answer.notes
    assert any("nothing to compare at axis 2" in note for note in notes)
    assert any(note.startswith("Readings of reading_V that are not compared: 1 (single") for note in notes)
    assert any("without temperature: cold-lubricant-friction" in note for note in notes)
    assert not any("current-sensor-bias" in note for note in notes)


class WithLibrary(Level):
    """The level, with the whole library."""

    def candidates(self, library: object) -> object:  # type: ignore[override]
        """Return the library."""
        return library


def test_whether_a_machine_can_reverse_is_asked_for_where_an_experiment_needs_it() -> None:
    """Where the recording has one direction, an experiment varies it, and the simulation does not say."""
    columns = {**table(), "speed_rad_s": np.abs(table()["speed_rad_s"]) + 0.1}
    problem = problem_of(columns)
    reverse = Indistinguishable(("drag", "power"), "drive both ways", ("direction",), 60.0, lift=False)
    (note,) = one_way_only(problem, [reverse])
    assert "state in one_way whether the machine can reverse" in note
    assert one_way_only(problem, [replace(reverse, vary=("wheel_speed",))]) == []
    assert one_way_only(problem_of(table()), [reverse]) == []

    class Stated(Level):
        one_way = False

    stated = build_problem(from_columns(columns, unit="axis"), Stated())
    assert one_way_only(stated, [reverse]) == []
