"""The problem: prediction, mask, covariates and tangents of a machine that is linear in everything."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, STEP_S, Level, problem_of, table

from regolithd.calibration.mismatch import Prior, RecordingError, Simulation, compare, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.prior import SensorError, own_name, parted_own_name
from regolithd.calibration.mismatch.problem.problem import StatedEffect
from regolithd.calibration.mismatch.thresholds import Thresholds

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = np.ndarray


def test_prediction_and_covariates_have_the_recording_s_shape() -> None:
    """The contract's covariates are derived from the speed; the magnitude of the prediction is the torque."""
    problem = problem_of(table())
    assert problem.prediction.shape == (INSTANTS, AXES)
    assert set(problem.covariates) == {
        "wheel_speed", "time", "torque", "direction", "wheel_acceleration", "wheel_angle"
    }  # fmt: skip
    assert problem.length_s == (INSTANTS - 1) * STEP_S
    assert problem.mean_size == pytest.approx(2.0, rel=0.02)
    assert problem.has("direction", "time")
    assert not problem.has("direction", "temperature")
    speed = problem.covariates["wheel_speed"]
    moving = np.abs(speed) > 0.01 * np.max(np.abs(speed))
    np.testing.assert_array_equal(problem.covariates["direction"][moving], np.sign(speed[moving]))
    np.testing.assert_allclose(problem.covariates["torque"], 2.0)


def test_acceleration_and_angle_are_derivative_and_integral_of_the_speed() -> None:
    """By central differences and by the trapezium rule."""
    problem = problem_of(table())
    speed = problem.covariates["wheel_speed"]
    np.testing.assert_allclose(
        problem.covariates["wheel_acceleration"][1:-1], (speed[2:] - speed[:-2]) / (2 * STEP_S), atol=1e-9
    )
    steps = np.diff(problem.covariates["wheel_angle"], axis=0)
    np.testing.assert_allclose(steps, 0.5 * (speed[1:] + speed[:-1]) * STEP_S, atol=1e-9)
    assert not problem.covariates["wheel_angle"][0].any()


def test_nothing_is_differentiated_across_a_gap_or_between_runs() -> None:
    """The time runs on from one run to the next, and stands still in no gap."""
    columns = table(runs=2)
    columns["t_s"] = columns["t_s"] + 60.0 * (columns["t_s"] >= 100)
    problem = problem_of(columns)
    time_s, acceleration = problem.time_s[:, 0], problem.covariates["wheel_acceleration"]
    speed = problem.covariates["wheel_speed"]
    gap = int(np.argmax(np.diff(time_s)))
    assert np.diff(time_s)[gap] == pytest.approx(60.5)
    one_sided = 0.5 * (speed[gap] - speed[gap - 1]) / STEP_S
    np.testing.assert_allclose(acceleration[gap], one_sided)
    assert np.all(np.diff(time_s) > 0)
    between = INSTANTS // 2
    assert np.diff(time_s)[between - 1] == pytest.approx(STEP_S)
    assert np.diff(problem.covariates["wheel_angle"], axis=0)[between - 1] == pytest.approx(0.0)


def test_what_never_varies_is_no_covariate() -> None:
    """But for those that candidates need even so."""

    class WithTemperature(Level):
        """Has a temperature that stays the same, and a pressure that was never measured."""

        def covariates(self, inputs: object) -> dict[str, np.ndarray]:
            """Return them beside the speed."""
            found = super().covariates(inputs)  # type: ignore[arg-type]
            still = np.full_like(found["wheel_speed"], 20.0)
            return {**found, "temperature": still, "pressure": still * np.nan, "voltage": np.sin(found["time"])}

    problem = build_problem(from_columns(table(), unit="axis"), WithTemperature())
    assert "voltage" in problem.covariates
    assert not {"temperature", "pressure"} & set(problem.covariates)
    assert "torque" in problem.covariates


def test_single_readings_far_out_are_no_part_of_the_problem() -> None:
    """Fifteen deviations by default."""
    columns = table(noise=0.2)
    columns["reading_V"][[100, 301]] = [2 + 0.2 * 20, 2 + 0.2 * 10]
    problem = problem_of(columns)
    assert not problem.mask[50, 0]
    assert problem.mask.sum() == INSTANTS * AXES - 1
    assert problem.filled[50, 0] == problem.prediction[50, 0]
    assert problem_of(columns, Thresholds(outlier_deviations=8.0)).mask.sum() == INSTANTS * AXES - 2


def test_tangents_and_secants_are_difference_quotients() -> None:
    """Of the level: 1; they are computed once."""
    problem = problem_of(table())
    np.testing.assert_allclose(problem.tangent("level"), 1.0)
    np.testing.assert_allclose(problem.secant("level", 0.5), 1.0)
    assert problem.secant("level", 0.5) is problem.secant("level", 0.5)
    np.testing.assert_allclose(problem.changed(level=5.0), 5.0)
    np.testing.assert_allclose(problem.input_tangent("speed_rad_s"), 0.0)
    np.testing.assert_allclose(problem.with_input("speed_rad_s", np.full((INSTANTS, AXES), np.nan)), problem.filled)


def test_a_covariate_without_blanks_is_made_once_for_each_set_of_covariates() -> None:
    """0 where it is not known, and not to be written to; a copy of the problem with others has its own."""
    problem = problem_of(table())
    speed = np.where(problem.time_s > 10, problem.covariates["wheel_speed"], np.nan)
    other = replace(problem, covariates={**problem.covariates, "wheel_speed": speed})
    assert problem.known("wheel_speed") is problem.known("wheel_speed")
    np.testing.assert_array_equal(problem.known("wheel_speed"), problem.covariates["wheel_speed"])
    np.testing.assert_array_equal(other.known("wheel_speed"), np.nan_to_num(speed))
    with pytest.raises(ValueError, match="read-only"):
        other.known("wheel_speed")[0] = 1.0


def test_variance_within_wheels_leaves_out_what_differs_between_them() -> None:
    """A factor that is 1 on one axis and 3 on the other does not change on any."""
    problem = problem_of(table())
    apart = np.broadcast_to([1.0, 3.0], problem.mask.shape)
    assert problem.variance_within(apart) == 0
    assert not problem.changes_within(apart)
    assert problem.changes_within(apart + 0.5 * np.sin(problem.time_s))
    assert not problem.changes_within(apart + 0.05 * np.sin(problem.time_s))


def test_what_cannot_be_compared_is_an_error() -> None:
    """A missing column is named; too few readings are counted."""
    columns = table()
    del columns["speed_rad_s"]
    with pytest.raises(RecordingError, match="needs speed_rad_s"):
        problem_of(columns)
    columns = table()
    columns["reading_V"][60:] = np.nan
    with pytest.raises(RecordingError, match=r"only 60 values of reading_V .* at least 100"):
        problem_of(columns)
    columns = table()
    columns["speed_rad_s"][60:] = np.nan
    with pytest.raises(RecordingError, match=r"only 60 values .*; 1540 are not: speed_rad_s was not measured there"):
        problem_of(columns)


class Doubling(Simulation):
    """A state that each step of the clock doubles."""

    channel, unit = "reading_V", "V"
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"gain": Prior(1.0, 0.1)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the state."""
        return values["gain"] * 2.0 ** np.arange(float(len(inputs["t_s"])))[:, None] + 0 * inputs["speed_rad_s"]


def test_a_prediction_without_bound_is_an_error_that_names_when_and_the_step() -> None:
    """A billion times the largest reading is no value of any unit."""
    columns = {"t_s": 7 * np.arange(300.0), "reading_V": np.ones(300), "speed_rad_s": np.ones(300)}
    with pytest.raises(
        RecordingError, match=r"grows without bound: at t = 210 s .* rows are 7 s apart: check that t_s"
    ):
        build_problem(from_columns(columns), Doubling())


@pytest.mark.parametrize(("factor", "told"), [(1000.0, True), (0.001, True), (3.0, False)])
def test_readings_in_another_unit_have_a_note(factor: float, told: bool) -> None:
    """A thousand times what is predicted is no physics."""
    columns = table()
    columns["reading_V"] = columns["reading_V"] * factor
    assert any("check its unit" in note for note in problem_of(columns).recording.notes) is told


def test_a_simulation_without_sides_has_no_sets_and_no_contrasts() -> None:
    """A wheel's own deviation of a parameter has a name that says so."""
    problem = problem_of(table())
    assert problem.wheel_sets == ()
    assert problem.contrasts("roll") == {}
    assert own_name("gain", 4) == "gain of 4"
    assert parted_own_name("gain of 4", ["idle", "gain"]) == ("gain", "4")
    assert parted_own_name("gain_factor of 4", ["idle", "gain"]) is None


def test_a_stated_effect_is_added_unless_the_simulation_has_it() -> None:
    """By default the simulation's own prediction lacks it."""
    problem = problem_of(table())
    column = np.full(problem.mask.shape, 0.5)
    outside = StatedEffect("drag", (1, 2), column, 0.1)
    inside = StatedEffect("slope", (1,), 3 * column, 0.1, in_simulation=True)
    np.testing.assert_array_equal(replace(problem, stated=(outside, inside, outside)).added, 2 * column)
    assert not problem.added.any()


@pytest.mark.parametrize("per_V", [1.0, -1000.0])
def test_a_covariate_is_not_the_reading_that_is_predicted(per_V: float) -> None:
    """In whatever unit, it would explain the noise of each reading, and a note says what to return instead."""

    class OwnReading(Level):
        def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
            return {**super().covariates(inputs), "place": per_V * inputs["reading_V"]}

    problem = build_problem(from_columns(table(), unit="axis"), OwnReading())
    assert "place" not in problem.covariates
    (note,) = problem.recording.notes
    assert note.startswith("place is the reading of reading_V itself")


def test_a_predicted_column_that_is_an_input_too_is_compared_as_read() -> None:
    """Its stated error smooths what `predict` sees of it, and nothing of what the prediction is held against."""

    class OwnInput(Level):
        inputs = ("reading_V",)
        sensors: ClassVar = {"reading_V": SensorError(absolute=0.2)}

    columns = table()
    problem = build_problem(from_columns(columns, unit="axis"), OwnInput())
    np.testing.assert_array_equal(problem.measured.ravel(), columns["reading_V"])
    assert np.std(problem.recording.channels["reading_V"]) < 0.8 * np.std(columns["reading_V"])


class Limited(Level):
    """The level; in the first half there is none above the stated value, in the last ten instants none but there."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level, NaN where it is at a stop."""
        found = super().predict(inputs, values)
        found[: INSTANTS // 2] = np.nan if values["level"] > 2.0 else values["level"]
        found[-10:] = np.nan if values["level"] != 2.0 else values["level"]
        return found


def test_a_tangent_is_of_the_sides_on_which_there_is_a_prediction() -> None:
    """By one side where the other has none, and 0 where neither has: the readings are compared all the same."""
    columns = table()
    problem = build_problem(from_columns(columns, unit="axis"), Limited())
    assert problem.mask.all()
    tangent = problem.tangent("level")
    np.testing.assert_allclose(tangent[:-10], 1.0)
    np.testing.assert_array_equal(tangent[-10:], 0.0)
    answer = compare(from_columns(columns, unit="axis"), Limited()).answer
    (level,) = answer.parameters
    assert answer.verdict == "consistent"
    assert level.low < 2.0 < level.high
