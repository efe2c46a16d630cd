"""A late channel: dead time or a filter, told apart, with the delay that it has."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.candidates.late_columns import as_shown
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.delayed import filtered, shifted, smoothed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
COUNT, STEP_S = 4000, 0.1
TIME_S = STEP_S * np.arange(COUNT)
DELAY = SensorDelay()
KINDS = ("secant_s", "filter_s", "smoothing_s")


class Lift(Simulation):
    """The current of a lift is its load; at standstill the simulation says nothing."""

    channel, unit = "current_A", "A"
    inputs = ("load_A", "moving")
    parameters: ClassVar = {"gain": Prior(1.0, 0.02, "1")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the load while it moves."""
        return np.where(inputs["moving"] > 0.5, values["gain"] * inputs["load_A"], np.nan)


def loads() -> tuple[Array, Array]:
    """Return the load that steps every 2 to 6 s, and whether the lift moves, shape (time,) each."""
    random = np.random.default_rng(5)
    lengths = random.integers(20, 60, 300)
    load = np.repeat(random.uniform(2, 8, 300), lengths)[:COUNT]
    return load, (np.repeat(random.random(300) > 0.3, lengths)[:COUNT]).astype(float)


def problem_of(recorded: Array, load: Array, moving: Array) -> Problem:
    """Return the problem that a recording of the lift poses."""
    columns = {"t_s": TIME_S, "load_A": load, "moving": moving, "current_A": recorded}
    return build_problem(from_columns(columns), Lift())


def late(values: Array, kind: str, delay: float) -> Array:
    """Return values (time,) late by a dead time, or behind a filter of their course or readings, by definition."""
    if kind == "secant_s":
        return np.interp(TIME_S - delay, TIME_S, values)
    if kind == "smoothing_s":
        kept = np.exp(-STEP_S / delay)
        return np.array(list(accumulate(values, lambda before, now: kept * before + (1 - kept) * now)))
    found, fine = values[0], 200
    course = []
    for before, now in zip(np.append(values[0], values[:-1]), values, strict=True):
        for part in range(fine):
            found += (before + (now - before) * (part + 0.5) / fine - found) * STEP_S / fine / delay
        course.append(found)
    return np.array(course)


@pytest.mark.parametrize("delay", [0.15, 0.8, 4.0])
def test_a_filter_is_that_of_its_differential_equation(delay: float) -> None:
    """τ dy/dt = x − y, with x on straight lines between the readings, integrated in fine steps."""
    load, moving = loads()
    recording = problem_of(load, load, moving).recording
    np.testing.assert_allclose(
        filtered(recording, load[:, None], delay)[:, 0], late(load, "filter_s", delay), atol=0.02
    )


def test_a_smoothing_is_that_of_its_recursion() -> None:
    """A digital filter takes a share of each reading; with many in its time constant it is the filter."""
    load, moving = loads()
    recording = problem_of(load, load, moving).recording
    for delay in (0.15, 4.0):
        found = smoothed(recording, load[:, None], delay)
        np.testing.assert_allclose(found[:, 0], late(load, "smoothing_s", delay))
    np.testing.assert_allclose(found, filtered(recording, load[:, None], 4.0), atol=0.1)


def test_a_filter_begins_anew_after_a_gap_and_in_each_run() -> None:
    """Nothing is known of what it held meanwhile."""
    load, moving = loads()
    recording = problem_of(load, load, moving).recording
    times = recording.time_s + 50.0 * (np.arange(COUNT) >= 1000)
    gone = replace(recording, time_s=times, run=(np.arange(COUNT) >= 2500).astype(int))
    found = filtered(gone, load[:, None], 2.0)[:, 0]
    assert found[[0, 1000, 2500]] == pytest.approx(load[[0, 1000, 2500]])


@pytest.mark.parametrize("kind", KINDS)
def test_a_late_channel_reports_at_a_start_what_it_was_at_standstill(kind: str) -> None:
    """Where the simulation says nothing, what was recorded there stands for it."""
    load, moving = loads()
    true = np.where(moving > 0.5, load, 0.3)
    problem = problem_of(late(true, kind, 0.5), load, moving)
    (column,) = DELAY.columns(problem, {"late": "current_A", kind: 0.5})
    starts = np.flatnonzero(np.diff(moving) > 0) + 1
    expected = (late(true, kind, 0.5) - load) / 0.5
    np.testing.assert_allclose(column[starts[5:], 0], expected[starts[5:]], atol=0.6)
    assert np.isfinite(column[problem.mask]).all()


@pytest.mark.parametrize("kind", ["filter_s", "smoothing_s"])
def test_a_filter_goes_on_from_what_it_put_out_at_a_standstill(kind: str) -> None:
    """It has not forgotten the motion before when the next begins, whatever the current was meanwhile."""
    load, moving = loads()
    recorded = late(np.where(moving > 0.5, load, 1 + np.sin(TIME_S / 50)), kind, 3.0)
    problem = problem_of(recorded, load, moving)
    (column,) = DELAY.columns(problem, {"late": "current_A", kind: 3.0})
    behind = (problem.prediction + 3.0 * column)[problem.mask]
    np.testing.assert_allclose(behind[100:], problem.measured[problem.mask][100:], atol=0.05)
    whole = replace(problem, late=(kind, 3.0))
    (shown,) = as_shown(whole, [problem.tangent("gain")])
    begun = np.flatnonzero(np.diff(moving) > 0)[3:]
    assert np.abs(shown[begun]).max() < 1e-9


def test_without_a_reading_a_straight_line_bridges_the_gap() -> None:
    """So that one blank does not blank a filter's whole run."""
    load, moving = loads()
    recorded = np.where(moving > 0.5, load, np.nan)
    problem = problem_of(recorded, load, moving)
    for kind in KINDS:
        (column,) = DELAY.columns(problem, {"late": "current_A", kind: 0.5})
        assert np.isfinite(column[problem.mask]).all()


@pytest.mark.parametrize(
    ("kind", "delay"),
    [("secant_s", 0.25), ("secant_s", 0.9), ("filter_s", 0.25), ("filter_s", 0.9), ("smoothing_s", 0.25)],
)
def test_each_kind_is_found_with_its_delay(kind: str, delay: float) -> None:
    """From two and a half readings on; a smoothing over many readings is a filter."""
    load = loads()[0] + 4 * np.abs(TIME_S % 3 - 1.5)
    random = np.random.default_rng(3)
    recorded = late(load, kind, delay) + 0.2 * random.normal(size=COUNT)
    columns = {"t_s": TIME_S, "load_A": load, "moving": np.ones(COUNT), "current_A": recorded}
    found = compare(columns, Lift())
    (effect,) = found.answer.effects
    assert effect.name == "sensor-delay"
    assert effect.parameters["delay_s"].value == pytest.approx(delay, rel=0.1)
    assert kind in found.evidence.contributions[0].shape


def test_the_share_of_the_change_is_kept_apart_from_the_delay() -> None:
    """With it in the shape the coefficient is the delay; far from 1 it is no delay."""
    load, moving = loads()
    problem = problem_of(load, load, moving)
    shape = {"late": "current_A", "secant_s": 0.5}
    assert DELAY.stated_coefficient(shape) == (0.5, 0.2)
    assert DELAY.stated_coefficient({"late": "load_A", "input_secant_s": 0.5}) == (0.5, 0.025)
    assert DELAY.left_open(problem, "input_secant_s") == pytest.approx(problem.recording.step_s / 12**0.5, rel=0.01)
    assert DELAY.left_open(problem, "secant_s") == 0.0
    with_share = DELAY.shape_at(shape, 0.4)
    assert with_share["passed"] == pytest.approx(0.8)
    np.testing.assert_allclose(
        0.5 * DELAY.columns(problem, with_share), 0.4 * DELAY.columns(problem, shape), equal_nan=True
    )
    assert DELAY.plausible(problem, with_share, [0.5])
    assert not DELAY.plausible(problem, {**shape, "passed": 0.4}, [0.5])
    assert not DELAY.plausible(problem, {**shape, "passed": 2.5}, [0.5])


def test_a_shift_is_within_its_run() -> None:
    """What another run ended with is not what this one begins with."""
    load, moving = loads()
    recording = replace(problem_of(load, load, moving).recording, run=(np.arange(COUNT) >= 2000).astype(int))
    assert shifted(recording, load[:, None], -5.0)[2000:2050, 0] == pytest.approx(np.full(50, load[2000]))


class Cart(Simulation):
    """A cart rolls; near standstill, where the friction's sign is not certain, the simulation says nothing."""

    channel, unit = "current_A", "A"
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"friction_A": Prior(2.0, 0.1, "A")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the friction."""
        speed = inputs["speed_rad_s"]
        return np.where(np.abs(speed) > 0.4, values["friction_A"] * np.sign(speed), np.nan)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


def test_near_standstill_the_prediction_goes_on_as_long_as_the_motion() -> None:
    """The cart slows down, stands and goes on or reverses: a late friction begins and ends with the motion."""
    speed = np.round(np.clip(1.5 * np.sin(TIME_S / 9) + 0.8 * np.sin(TIME_S / 4), -1, 1), 1)
    friction = np.where(speed == 0, 0.3, 2.0 * np.sign(speed))
    problem = build_problem(
        from_columns({"t_s": TIME_S, "speed_rad_s": speed, "current_A": late(friction, "secant_s", 0.5)}), Cart()
    )
    (column,) = DELAY.columns(problem, {"late": "current_A", "secant_s": 0.5})
    behind = np.where(problem.mask, problem.prediction + 0.5 * column, problem.measured)
    np.testing.assert_allclose(behind[5:], problem.measured[5:], atol=1e-9)


class Winch(Cart):
    """The same with a sensor that is exactly 0 at rest: there the motor has no current."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the friction."""
        return np.where(inputs["speed_rad_s"] == 0, 0.0, super().predict(inputs, values))


@pytest.mark.parametrize("kind", KINDS)
def test_between_rest_and_motion_the_axis_moves(kind: str) -> None:
    """Readings after 0 that are too slow for a direction are of the motion: late friction is a step, and no ramp."""
    speed = np.where(np.arange(COUNT) // 100 % 2, np.clip(np.arange(COUNT) % 100 / 15, 0.1, 1.0), 0.0)
    friction = np.where(speed == 0, 0.0, 2.0)
    problem = build_problem(
        from_columns({"t_s": TIME_S, "speed_rad_s": speed, "current_A": late(friction, kind, 0.5)}), Winch()
    )
    assert not problem.mask[:, 0].all()
    (column,) = DELAY.columns(problem, {"late": "current_A", kind: 0.5})
    behind = problem.prediction + 0.5 * column
    np.testing.assert_allclose(behind[problem.mask][5:], problem.measured[problem.mask][5:], atol=1e-3)


def test_a_blank_without_a_change_of_direction_is_no_standstill() -> None:
    """What the simulation does not predict there is what was recorded there."""
    speed = np.where(np.arange(COUNT) // 100 % 2, 0.3, 0.9)
    recorded = np.where(speed > 0.4, 2.0, 5.0)
    columns = {"t_s": TIME_S, "speed_rad_s": speed, "current_A": late(recorded, "secant_s", 0.5)}
    problem = build_problem(from_columns(columns), Cart())
    (column,) = DELAY.columns(problem, {"late": "current_A", "secant_s": 0.5})
    behind = np.where(problem.mask, problem.prediction + 0.5 * column, problem.measured)
    np.testing.assert_allclose(behind[5:], problem.measured[5:], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("every", [10, None])
def test_what_a_late_channel_shows_does_not_depend_on_which_of_its_readings_are_blank(
    kind: str, every: int | None
) -> None:
    """A channel that is read in every tenth row, or has a third of its readings blank: tangents are late as without."""
    load, _ = loads()
    moving = np.ones(COUNT)
    recorded = late(load, kind, 0.75)
    seen = np.arange(COUNT) % every == 0 if every else np.random.default_rng(3).random(COUNT) > 0.3
    whole = replace(problem_of(recorded, load, moving), late=(kind, 0.75))
    part = replace(problem_of(np.where(seen, recorded, np.nan), load, moving), late=(kind, 0.75))
    (expected,), (found,) = (as_shown(problem, [problem.tangent("gain")]) for problem in (whole, part))
    assert part.mask.sum() < whole.mask.sum()
    np.testing.assert_allclose(found[part.mask], expected[part.mask], rtol=1e-9)


def test_a_column_that_is_unknown_in_a_few_rows_is_late_beside_them() -> None:
    """A filter would carry what is not known on to the end of the run."""
    load, _ = loads()
    problem = replace(problem_of(load, load, np.ones(COUNT)), late=("filter_s", 0.75))
    column = np.sin(TIME_S)[:, None]
    (expected,) = as_shown(problem, [column])
    column[100:103] = np.nan
    (found,) = as_shown(problem, [column])
    np.testing.assert_allclose(found, expected, atol=0.02)
