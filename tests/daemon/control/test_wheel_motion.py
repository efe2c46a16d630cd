"""What the wheels are measured to do: distances, and whether they follow the command."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.control.wheel_motion import WheelMotion
from regolithd.daemon.pipeline.snapshot import ROW, Snapshot
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED

CONFIGURATION = Configuration()
COMMANDED = 0.022 / 0.075
_SECOND = 1_000_000_000


class Driven:
    """Six wheels, sampled twice a second; each turns at a share of the commanded speed."""

    def __init__(self, commanded: float = COMMANDED) -> None:
        self.motion = WheelMotion(CONFIGURATION)
        self.speed = commanded
        self.now_ns = 10 * _SECOND
        self.step(*[0.0] * 6)
        self.motion.begin(forward=commanded > 0)
        self.motion.commanded(commanded)

    def step(self, *shares: float) -> None:
        """Take one snapshot, half a second after the last."""
        values = np.full((len(ROW), 6), np.nan)
        values[ROW[MOTOR_SPEED]] = np.array(shares) * self.speed * CONFIGURATION.drivetrain.ratio
        self.now_ns += _SECOND // 2
        self.motion.take(Snapshot(0, self.now_ns, values))

    def drive(self, seconds: float, *shares: float) -> None:
        """Take snapshots for some time."""
        for _ in range(int(2 * seconds)):
            self.step(*shares)

    def stop(self) -> None:
        """Command speed 0, and measure the standstill."""
        self.motion.commanded(0.0)
        self.drive(1.0, *[0.0] * 6)


@pytest.mark.parametrize("commanded", [COMMANDED, -COMMANDED])
def test_the_distance_is_the_integral_of_the_measured_speed(commanded: float) -> None:
    """Ten seconds at half the speed are half the distance, forwards and backwards."""
    driven = Driven(commanded)
    driven.drive(10.0, *[0.5] * 6)
    driven.stop()
    assert driven.motion.turned_m == pytest.approx(10.0 * 0.022 / 2, rel=1e-9)


@pytest.mark.parametrize(
    ("shares", "named"),
    [
        ((1, 1, 0, 1, 1, 1), ["wheel 3 (node 3) at 0.000"]),
        ((1, 1, 1, -1, 1, 1), ["wheel 4 (node 4) at -0.293"]),
        ((0.56,) * 6, [f"wheel {k} (node {k}) at 0.164" for k in range(1, 7)]),
        ((1, 1, 1, 1, 1, 1.5), ["wheel 6 (node 6) at 0.440"]),
        ((0.9, 1.1, 1, 1, 1, 1), []),
        ((np.nan,) * 6, []),
    ],
)
def test_a_wheel_that_does_not_follow_is_named_within_a_few_seconds(
    shares: tuple[float, ...], named: list[str]
) -> None:
    """Blocked, backwards, saturated and too fast are told; a tenth off, and not measured, are not."""
    driven = Driven()
    driven.drive(4.0, *shares)
    assert [name for name in named if name not in driven.motion.problem] == []
    assert driven.motion.problem.count("wheel") == len(named)


def test_a_wheel_on_a_slow_ramp_follows() -> None:
    """A speed that takes ten seconds to reach its end is no problem meanwhile."""
    driven = Driven()
    for step in range(40):
        driven.step(*[min(1.0, step / 20)] * 6)
    assert driven.motion.problem == ""


def test_a_wheel_that_stops_on_the_way_is_named() -> None:
    """It had followed before."""
    driven = Driven()
    driven.drive(20.0, *[1] * 6)
    assert driven.motion.problem == ""
    driven.drive(4.0, 1, 1, 1, 1, 0, 1)
    assert "wheel 5 (node 5) at 0.000" in driven.motion.problem


@pytest.mark.parametrize(
    ("shares", "named"),
    [((1,) * 6, ""), ((1, 0.97, 1, 1, 1, 1), ""), ((1, 0.9, 1, 1, 1, 1), "wheel 2 (node 2) 0.396 m")],
)
def test_less_than_the_distance_is_told(shares: tuple[float, ...], named: str) -> None:
    """More than a twentieth, beside the SYNC period at begin and end, is named with what was turned."""
    driven = Driven()
    driven.drive(20.0, *shares)
    driven.stop()
    assert named in driven.motion.shortfall(0.44, 0.022)
    assert bool(driven.motion.problem) is bool(named)


def test_readings_that_are_missing_for_a_while_cost_no_distance() -> None:
    """The speed is interpolated over two seconds, but not over ten."""
    for gap_s, turned_s in ((2.0, 12.0), (10.0, 10.0)):
        driven = Driven()
        driven.drive(5.0, *[1] * 6)
        driven.drive(gap_s, *[np.nan] * 6)
        driven.drive(5.0, *[1] * 6)
        driven.stop()
        seen_s = driven.motion.turned_m / 0.022
        assert seen_s == pytest.approx(turned_s, abs=0.6)


def test_a_clock_that_is_set_adds_no_distance() -> None:
    """An hour forwards or backwards between two SYNCs is left out."""
    driven = Driven()
    driven.drive(5.0, *[1] * 6)
    for jump_s in (3600, -7200):
        driven.now_ns += jump_s * _SECOND
        driven.drive(5.0, *[1] * 6)
    driven.stop()
    assert driven.motion.turned_m == pytest.approx(15 * 0.022, rel=0.1)
