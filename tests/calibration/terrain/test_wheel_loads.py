"""Wheel loads balance weight and moments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.parameters import GRAVITY_M_S2, Rover
from regolithd.calibration.terrain.wheel_loads import wheel_loads


@given(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3))
def test_loads_balance_weight_and_moments(pitch: float, roll: float) -> None:
    """The six loads add up to the weight normal to the ground, and their moments balance the centre of gravity's."""
    rover = Rover()
    loads = wheel_loads(np.float64(pitch), np.float64(roll), rover)
    assert loads.sum() == pytest.approx(30 * GRAVITY_M_S2 * np.cos(pitch) * np.cos(roll))
    forward = np.array([1, 1, 0, 0, -1, -1]) * rover.wheelbase_m / 2
    assert loads @ forward / loads.sum() == pytest.approx(-0.25 * np.tan(pitch), abs=1e-12)
    left = np.array([1, -1, 1, -1, 1, -1]) * rover.track_m / 2
    assert loads @ left / loads.sum() == pytest.approx(-0.25 * np.tan(roll), abs=1e-12)


def test_level_ground_loads_all_wheels_alike() -> None:
    """Without pitch and roll each wheel carries a sixth of the weight, 49.03 N for 30 kg."""
    loads = wheel_loads(np.zeros(3), np.zeros(3), Rover())
    np.testing.assert_allclose(loads, np.full((3, 6), 49.03325))


def test_no_load_is_negative() -> None:
    """On a slope that would lift the front axle its wheels carry zero."""
    loads = wheel_loads(np.float64(1.2), np.float64(0.0), Rover())
    assert loads.min() == 0
