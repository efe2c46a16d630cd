"""Words and units in an answer are those of the user's machine."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.problem.words import (
    divided,
    in_units,
    in_words,
    label_of_column,
    labels_of,
    unit_in_label,
)


@pytest.mark.parametrize(
    ("column", "label"),
    [
        ("carriage_speed_m_s", "carriage speed (m/s)"),
        ("motor_acceleration_rad_s2", "motor acceleration (rad/s²)"),
        ("oil_temperature_degC", "oil temperature (°C)"),
        ("gearbox_degC", "gearbox temperature (°C)"),
        ("brake_temp_K", "brake temp (K)"),
        ("shaft_rpm", "shaft (rpm)"),
        ("inflow_m3_s", "inflow (m³/s)"),
        ("pull_N", "pull (N)"),
        ("gear", "gear"),
    ],
)
def test_a_column_s_name_is_a_label_with_its_unit(column: str, label: str) -> None:
    """Unit words at the end are a unit, seconds divide."""
    assert label_of_column(column) == label


def test_a_covariate_is_called_as_the_simulation_says_or_as_the_column_that_it_is() -> None:
    """What is derived from columns has no label of its own."""
    speed, load, derived = (np.full((3, 1), value) for value in (1.0, 2.0, 3.0))
    covariates = {"wheel_speed": speed, "load": load, "power": derived}
    channels = {"belt_speed_m_s": speed.copy(), "pull_N": load}
    found = labels_of({"load": "pull of the rope (kN)"}, covariates, channels)
    assert found == {"wheel_speed": "belt speed (m/s)", "load": "pull of the rope (kN)"}


def test_a_column_that_differs_late_is_another_one() -> None:
    """However long the beginning is that two columns have in common, blanks included."""
    speed = np.append(np.full(5000, np.nan), 1.0)[:, None]
    assert labels_of({}, {"speed": speed}, {"slow_m_s": 2 * speed, "belt_m_s": speed.copy()}) == {"speed": "belt (m/s)"}


def test_the_prediction_as_a_covariate_is_called_so_or_as_the_simulation_calls_the_torque() -> None:
    """It is no column of its own."""
    size = np.full((3, 1), 48.0)
    covariates, predicted = {"pack": size.copy()}, {"pack_V": size}
    assert labels_of({}, covariates, {}, predicted)["pack"] == "predicted pack voltage (V)"
    assert labels_of({"torque": "predicted voltage (V)"}, covariates, {}, predicted)["pack"] == "predicted voltage (V)"


def test_an_instruction_has_the_machine_s_words() -> None:
    """A covariate in braces is replaced by its label without the unit, or by what it is called anywhere."""
    text = "hold the {wheel_speed}, then the {oil_pressure}"
    assert in_words(text, {"wheel_speed": "belt speed (m/s)"}) == "hold the belt speed, then the oil pressure"


@pytest.mark.parametrize(
    ("label", "viscous", "quadratic", "inertia"),
    [
        ("speed", "N s/rad", "N s²/rad²", "N s²/rad"),
        ("belt speed (m/s)", "N s/m", "N s²/m²", "N s²/m"),
        ("shaft speed (rpm)", "N/rpm", "N/rpm²", "N s/rpm"),
        ("feed (mm/min)", "N min/mm", "N min²/mm²", "N min s/mm"),
    ],
)
def test_a_coefficient_s_unit_follows_the_speed_s(label: str, viscous: str, quadratic: str, inertia: str) -> None:
    """One over the speed, over its square, over its rate of change in seconds."""
    units = "{unit} {per_speed}", "{unit} {per_speed2}", "{unit} {per_acceleration}"
    found = [in_units(unit, "N", {"wheel_speed": label}) for unit in units]
    assert found == [viscous, quadratic, inertia]


def test_a_unit_is_what_the_label_has_in_brackets_up_to_a_comma() -> None:
    """Time is in seconds; what has no label has no unit."""
    labels = {"pitch": "pitch (rad, nose up)", "load": "wheel load (N)", "slip": "slip"}
    units = {name: unit_in_label(name, labels) for name in ("pitch", "load", "slip", "yaw", "time")}
    assert units == {"pitch": "rad", "load": "N", "slip": "", "yaw": "", "time": "s"}


@pytest.mark.parametrize(
    ("speed", "unit"), [("rad/s", "A (s/rad)^p"), ("rpm", "A/rpm^p"), ("m³/h", "A (h/m³)^p"), ("1", "A")]
)
def test_a_free_power_of_the_speed_stays_a_power(speed: str, unit: str) -> None:
    """The coefficient of a power law has the unit of the channel over that power of the speed."""
    assert in_units("{unit} ({per_speed})^p", "A", {"wheel_speed": f"speed ({speed})"}) == unit


@pytest.mark.parametrize(
    ("unit", "by", "power", "expected"),
    [
        ("V", "A", "", "V/A"),
        ("1", "°F", "", "1/°F"),
        ("V", "V", "", "1"),
        ("A", "m", "³", "A/m³"),
        ("1", "A", "^p", "1/A^p"),
        ("bar", "m³/h", "²", "bar/(m³/h)²"),
        ("V", "1", "", "V"),
        ("1", "", "", "1"),
        ("N", "bar s h", "", "N/(bar s h)"),
    ],
)
def test_a_unit_over_another_is_written_as_people_write_it(unit: str, by: str, power: str, expected: str) -> None:
    """No brackets around one word, none of a pure number, and no 1 before another unit."""
    assert divided(unit, by, power) == expected
