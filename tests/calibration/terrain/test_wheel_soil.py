"""The wheel–soil model against reference values computed independently, and its limits."""

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.drivetrain.torque import motor_current
from regolithd.calibration.paper import equations
from regolithd.calibration.parameters import SOILS, Drivetrain, Wheel
from regolithd.calibration.terrain import wheel_soil

WHEEL = Wheel()
angles = st.floats(0.05, 1.5).map(np.float64)


@pytest.fixture(scope="module")
def reference(shared_folder: Path) -> list[dict[str, str]]:
    """Rows of the reference table: soil, load, slip, contact angle, torque, motor current."""
    with (shared_folder / "reference" / "rover-wheel.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("name", SOILS)
def test_reference_values_are_met(name: str, reference: list[dict[str, str]]) -> None:
    """Contact angle, torque and current of every row of the reference table agree to 1e-6."""
    rows = [row for row in reference if row["soil"] == name]
    keys = ("load_N", "slip", "contact_angle_rad", "torque_Nm", "motor_current_A")
    load, slip, angle, torque, current = (np.array([float(row[key]) for row in rows]) for key in keys)
    assert len(rows) > 10
    found = wheel_soil.contact_angle(load, slip, WHEEL, SOILS[name])
    np.testing.assert_allclose(found, angle, rtol=1e-6)
    found_torque = wheel_soil.wheel_torque(found, slip, WHEEL, SOILS[name])
    np.testing.assert_allclose(found_torque, torque, rtol=1e-6)
    found_current = motor_current(np.tile(found_torque[:, None], 6), np.ones(6), Drivetrain())[:, 0]
    np.testing.assert_allclose(found_current, current, rtol=1e-6)


@given(angles, st.floats(-0.2, 0.9).map(np.float64), st.sampled_from(sorted(SOILS)))
def test_load_and_torque_are_the_papers_closed_forms(angle: float, slip: float, name: str) -> None:
    """With the same peak stresses, load and torque are those of Eqs 6 and 7 as the paper writes them."""
    soil = SOILS[name]
    normal, shear = wheel_soil.peak_stresses(angle, slip, WHEEL, soil)
    load = equations.load(angle, normal, shear, np.float64(soil.cohesion_Pa), WHEEL.radius_m, WHEEL.width_m)
    torque = equations.torque(angle, shear, np.float64(soil.cohesion_Pa), WHEEL.radius_m, WHEEL.width_m)
    scale = normal * WHEEL.radius_m * WHEEL.width_m
    assert wheel_soil.carried_load(angle, slip, WHEEL, soil) == pytest.approx(load, rel=1e-9, abs=1e-9 * scale)
    assert wheel_soil.wheel_torque(angle, slip, WHEEL, soil) == pytest.approx(torque, rel=1e-9)


@given(st.floats(1e-5, 0.1).map(np.float64), st.sampled_from(sorted(SOILS)))
def test_mobilised_share_is_odd_and_at_most_one(displacement: float, name: str) -> None:
    """A wheel that is dragged mobilises the same share of the strength, with the other sign."""
    share = wheel_soil.mobilised_share(displacement, SOILS[name])
    assert 0 < share <= 1
    assert wheel_soil.mobilised_share(-displacement, SOILS[name]) == -share


@pytest.mark.parametrize("name", SOILS)
def test_contact_angle_inverts_the_carried_load(name: str) -> None:
    """The load at the contact angle of a load is that load, from 1 N to 150 N and from dragged wheels to slip 0.6."""
    load, slip = np.meshgrid(np.geomspace(1, 150, 25), np.linspace(-0.1, 0.6, 15))
    angle = wheel_soil.contact_angle(load, slip, WHEEL, SOILS[name])
    np.testing.assert_allclose(wheel_soil.carried_load(angle, slip, WHEEL, SOILS[name]), load, rtol=1e-9)


def test_a_load_without_solution_is_nan() -> None:
    """No load, a negative one, one that sinks the wheel to its axle, and NaN have no contact angle; the rest have."""
    load = np.array([0.0, -5.0, 1e7, np.nan, 49.0, 49.0])
    slip = np.array([0.02, 0.02, 0.02, 0.02, np.nan, 0.02])
    found = wheel_soil.contact_angle(load, slip, WHEEL, SOILS["sandy-loam"])
    np.testing.assert_array_equal(np.isfinite(found), [False, False, False, False, False, True])
