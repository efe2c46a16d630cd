"""The speed profiles of the closed-loop study."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.daemon.closed_loop.speed_profile import shuttle, traverse


def test_a_shuttle_has_both_directions_steps_and_stops() -> None:
    """Speeds are between 0.10 and 0.45 rad/s, reached within 2 s; about one leg in twelve is a stop."""
    profile = shuttle(3, 20_000.0, 10.0)
    assert (len(profile.time_s), profile.time_s[0], profile.time_s[1]) == (200_000, 0.0, 0.1)
    speed = profile.wheel_speed_rad_s
    assert speed[0] == 0.0
    held = np.isclose(np.diff(speed), 0.0)
    constant = np.abs(speed[1:][held])
    assert constant.max() <= 0.45
    assert constant[constant > 1e-9].min() >= 0.10
    assert 0.05 < np.mean(constant < 1e-9) < 0.12
    assert 0.3 < np.mean(speed < 0) < 0.7
    changes = np.flatnonzero(np.diff(held.astype(int)) == -1) / 10
    assert np.diff(changes).min() + 0.2 >= 20.0
    assert np.diff(changes).max() <= 100.2  # a leg may repeat a stop
    assert np.median(np.diff(changes)) == pytest.approx(35, abs=3)
    assert np.mean(held) == pytest.approx(1 - 2 / 35, abs=0.01)
    assert np.abs(np.diff(speed)).max() <= 0.9 / 2.0 / 10 + 1e-9


def test_a_traverse_only_goes_forward() -> None:
    """No stop and no reversal; the seed alone decides, and it differs from the shuttle's."""
    profile = traverse(3, 600.0, 2.0)
    assert len(profile.time_s) == 1200
    assert profile.wheel_speed_rad_s[4:].min() >= 0.10
    assert np.array_equal(profile.wheel_speed_rad_s, traverse(3, 600.0, 2.0).wheel_speed_rad_s)
    assert not np.array_equal(profile.wheel_speed_rad_s, traverse(4, 600.0, 2.0).wheel_speed_rad_s)
    assert not np.allclose(np.abs(shuttle(3, 600.0, 2.0).wheel_speed_rad_s), profile.wheel_speed_rad_s)
