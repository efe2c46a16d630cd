"""What each candidate states beside its columns: signs, wheels, units, bounds, and what its experiment varies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from law_problem import CANDIDATES, LOAD, SPEED, STEP_S, TIME_S, WARM, P

from regolithd.calibration.mismatch.candidates.load_cell_drift import OFFSETS
from regolithd.calibration.mismatch.candidates.wheel_angle_ripple import WheelAngleRipple

EITHER_SIGN = {
    "current-sensor-bias",
    "load-dependent-efficiency",
    "multi-pass-compaction",
    "soil-transition",
    "turning-resistance",
    "wheel-angle-ripple",
}
"""Effects that may add or take away; all others lose power, delay, or act one way by their law."""
ONE_WHEEL = {"bearing-drag", "current-sensor-bias", "load-cell-drift"}
"""Faults of one part."""
WHOLE_MACHINE = {"grade-resistance", "multi-pass-compaction", "slip-sinkage", "soil-transition", "turning-resistance"}
"""What the ground does to every wheel."""
ABSENT_WHEN_LIFTED = WHOLE_MACHINE | {"load-cell-drift"}
NOT_ALONG_MOTION = {"current-sensor-bias", "grade-resistance", "rotor-inertia", "sensor-delay"}
"""Effects that do not change sign with the direction of motion."""
RUN_UNLOADED = {"bearing-drag", "load-cell-drift", "soil-transition"}
UNITS = {
    "coulomb-friction": ["{unit}"],
    "viscous-friction": ["{unit} ({per_speed})^p"],
    "quadratic-drag": ["{unit} {per_speed2}"],
    "rotor-inertia": ["{unit} {per_acceleration}"],
    "torque-constant-temperature": ["1/K"],
    "sensor-delay": ["s"],
    "slip-sinkage": ["1"],
    "turning-resistance": ["{unit}", "{unit}"],
    "multi-pass-compaction": ["1", "1", "1"],
}


def test_physics_decides_about_signs() -> None:
    """A friction that drives is none; a loss at light load may be a gain at a heavy one."""
    signs = {name: {coefficient.sign for coefficient in each.coefficients} for name, each in CANDIDATES.items()}
    assert signs == {name: {0} if name in EITHER_SIGN else {1} for name in CANDIDATES}


def test_physics_decides_about_wheels() -> None:
    """A fault is of one wheel, the ground of all, and a property of the drive of one or all."""
    expected = {name: ("one",) if name in ONE_WHEEL else ("all",) if name in WHOLE_MACHINE else ("all", "one")
                for name in CANDIDATES}  # fmt: skip
    assert {name: each.sharing for name, each in CANDIDATES.items()} == expected


def test_what_the_ground_does_is_absent_with_the_wheels_lifted() -> None:
    """An experiment without load tells it from what the drive does; some experiments begin so."""
    assert {name for name, each in CANDIDATES.items() if not each.acts_unloaded} == ABSENT_WHEN_LIFTED
    assert {name for name, each in CANDIDATES.items() if not each.along_motion} == NOT_ALONG_MOTION
    assert {name for name, each in CANDIDATES.items() if each.run_unloaded} == RUN_UNLOADED


@pytest.mark.parametrize(("name", "units"), UNITS.items())
def test_a_coefficient_has_the_unit_of_its_law(name: str, units: list[str]) -> None:
    """In terms of the predicted channel's unit."""
    assert [coefficient.unit for coefficient in CANDIDATES[name].coefficients] == units


MINUTE_S = 60.0
COLDEST = float(np.quantile(WARM, 0.005))
BOUNDS = [
    ("bearing-drag", {"onset_s": 30.0, "rise_s": 0.0}, "onset_s", (0.05 * MINUTE_S, 0.97 * MINUTE_S)),
    ("soil-transition", {"onset_s": 30.0, "along": "time"}, "onset_s", (0.02 * MINUTE_S, 0.97 * MINUTE_S)),
    ("cold-lubricant-friction", {"scale_K": 10.0}, "scale_K", (5.0, 80.0)),
    (
        "cold-lubricant-friction",
        {"no_drag_above_degC": 10.0},
        "no_drag_above_degC",
        (max(float(np.quantile(WARM, 0.2)), COLDEST + 5), float(np.max(WARM)) + 40),
    ),
    ("load-cell-drift", {"relative_offset": 0.0}, "relative_offset", (-3.0, 0.85)),
    ("rotor-inertia", {"lag_s": 0.0}, "lag_s", (0.0, 4 * STEP_S)),
    ("sensor-delay", {"late": "current_A", "secant_s": 1.0}, "secant_s", (0.1 * STEP_S, 0.1 * MINUTE_S)),
    ("sensor-delay", {"late": "current_A", "filter_s": 1.0}, "filter_s", (0.1 * STEP_S, 0.1 * MINUTE_S)),
    (
        "stribeck-friction",
        {"stribeck_speed_rad_s": 0.1},
        "stribeck_speed_rad_s",
        (0.5 * float(np.quantile(np.abs(SPEED), 0.02)), 0.5 * float(np.quantile(np.abs(SPEED), 0.98))),
    ),
    ("viscous-friction", {"power": 1.0}, "power", (0.7, 1.4)),
]


@pytest.mark.parametrize(("name", "shape", "key", "bounds"), BOUNDS, ids=lambda value: str(value)[:25])
def test_a_shape_is_optimised_where_the_recording_can_tell_it(
    name: str, shape: dict[str, float | str], key: str, bounds: tuple[float, float]
) -> None:
    """Shares of the recording's length, readings, quantiles of what varied, or limits of the law itself."""
    found = CANDIDATES[name].bounds(P, shape)
    assert [name for name in found if name in shape] == [key]
    assert found[key] == pytest.approx(bounds)


def test_a_ripple_is_optimised_over_the_width_of_its_line() -> None:
    """Half a cycle over the angles that were met, within the orders that are looked at."""
    ripple = CANDIDATES["wheel-angle-ripple"]
    assert isinstance(ripple, WheelAngleRipple)
    width = np.pi / float(np.ptp(P.covariates["wheel_angle"]))
    assert ripple.bounds(P, {"order": 30.0})["order"] == pytest.approx((30 - width, 30 + width))
    assert ripple.bounds(P, {"order": 64.0})["order"][1] == 64
    turns = float(np.max(np.ptp(P.covariates["wheel_angle"], axis=0))) / (2 * np.pi)
    lowest = max(0.9, 4 / turns)
    assert ripple.bounds(P, {"order": lowest})["order"][0] == pytest.approx(lowest)
    lines = float(np.ptp(P.covariates["wheel_angle"])) / (2 * np.pi) * 64
    assert ripple.shape_count(P) == pytest.approx(max(10 * 3 * lines, 1))


@pytest.mark.parametrize(
    ("name", "shape", "key", "bounds", "expected"),
    [
        ("bearing-drag", {"onset_s": 30.0}, "onset_s", (0.6, 58.2), 60 * P.thresholds.onset_reach),
        ("bearing-drag", {"onset_s": 1.0}, "onset_s", (0.6, 58.2), 60 * P.thresholds.onset_reach),
        ("viscous-friction", {"power": 1.0}, "power", (0.7, 1.4), P.thresholds.shape_reach),
    ],
)
def test_a_shape_is_optimised_about_the_grid_s_point(
    name: str, shape: dict[str, float | str], key: str, bounds: tuple[float, float], expected: float
) -> None:
    """As far as the grid's neighbours: a share of the length for an onset, of the value for another, and in bounds."""
    at = float(shape[key])
    found = CANDIDATES[name].search_range(P, shape, key, bounds)
    assert found == pytest.approx((max(bounds[0], at - expected), min(bounds[1], at + expected)))
    assert found[0] < found[1]


def test_shapes_and_profiles_of_the_bearing_are_of_this_recording() -> None:
    """Rises of 3 and 15 % of its length, and powers of the time up to its end; the interval takes in further powers."""
    profiles = CANDIDATES["bearing-drag"].onset_profiles(P)
    rises = sorted(float(each["rise_s"]) for each in profiles if "rise_s" in each)
    powers = [float(each["power"]) for each in profiles if "power" in each]
    assert rises == pytest.approx([0.0, 1.8, 9.0])
    assert sorted(powers) == [0.12, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0]
    assert {each["full_at_s"] for each in profiles if "power" in each} == {MINUTE_S}


def test_the_offset_of_a_drift_is_looked_for_everywhere() -> None:
    """Where the current alone would have it, the cell may show another drift."""
    assert CANDIDATES["load-cell-drift"].search_range(P, {"relative_offset": 0.5}, "relative_offset", (-3.0, 0.85)) == (
        -3.0,
        0.85,
    )


def test_a_drift_is_simulated_between_its_bounds() -> None:
    """In ascending order, without an offset and at both bounds, in steps that no neighbour exceeds by far."""
    low, high = CANDIDATES["load-cell-drift"].bounds(P, {})["relative_offset"]
    steps = np.diff(OFFSETS)
    assert (OFFSETS[0], OFFSETS[-1]) == (low, high)
    assert 0.0 in OFFSETS
    assert np.all((steps > 0) & (steps <= 0.8))
    assert np.all(steps[np.array(OFFSETS[:-1]) >= -0.55] <= 0.2)


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_a_loss_is_relative_to_the_mean_reading_in_any_unit(factor: float) -> None:
    """A current in microamperes has the same shapes as one in amperes; a prediction of zero divides nothing by zero."""
    efficiency = CANDIDATES["load-dependent-efficiency"]
    scaled = replace(P, prediction=factor * P.prediction, made={})
    references = {float(shape["reference_size"]) for shape in efficiency.shapes(scaled)}
    assert list(references) == [pytest.approx(factor * float(np.mean(np.abs(P.prediction))))]
    nothing = replace(P, prediction=0 * P.prediction, made={})
    assert all(np.isfinite(efficiency.columns(nothing, shape)).all() for shape in efficiency.shapes(nothing))


def test_the_problem_of_these_tests_is_as_they_assume() -> None:
    """A minute, two readings a second, loads that do not reach zero."""
    assert (P.length_s, P.recording.step_s) == (MINUTE_S, STEP_S)
    assert float(TIME_S[-1, 0]) == MINUTE_S
    assert np.min(LOAD) > 0
