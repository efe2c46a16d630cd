"""Dead reckoning: straight, turning, on a slope, across gaps, without sensors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from estimates import estimate

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.dead_reckoning import DeadReckoning, HeadingSource, Pose, SpeedSource
from regolithd.daemon.pipeline.snapshot import ROW, Estimate, Snapshot
from regolithd.drivers.devices.ground_speed import GROUND_SPEED
from regolithd.drivers.devices.inclinometer import PITCH, YAW_RATE
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED

CONFIGURATION = Configuration()
STEP_S = 0.1


def at(time_s: float, *, speed: float = 0.05, yaw_rate: float = 0.0, pitch: float = 0.0) -> Estimate:
    """Return an estimate with this speed over ground [m/s], yaw rate [rad/s] and pitch [rad]."""
    sample = estimate()
    values = sample.snapshot.values.copy()
    values[ROW[GROUND_SPEED]], values[ROW[YAW_RATE]], values[ROW[PITCH]] = speed, yaw_rate, pitch
    return replace(sample, snapshot=Snapshot(0, 1_000_000_000 + round(time_s * 1e9), values))


def drive(*steps: Estimate) -> list[Pose]:
    """Return the poses that are reported."""
    reckoning = DeadReckoning(CONFIGURATION)
    return [pose for step in steps if (pose := reckoning.step(step)) is not None]


def test_a_quarter_circle_ends_to_the_left_and_ahead() -> None:
    """At 0.05 m/s and a yaw rate of 0.05 rad/s the path is a circle of 1 m: after 90 degrees both offsets are 1 m."""
    seconds = math.pi / 2 / 0.05
    pose = drive(*(at(number * STEP_S, yaw_rate=0.05) for number in range(round(seconds / STEP_S) + 1)))[-1]
    assert (pose.x_m, pose.y_m) == pytest.approx((1.0, 1.0), abs=0.03)
    assert pose.distance_m == pytest.approx(seconds * 0.05, abs=0.03)
    assert (pose.speed_source, pose.heading_source) == (SpeedSource.GROUND_SPEED, HeadingSource.YAW_RATE)


def test_it_is_reported_twice_a_second_while_the_rover_moves() -> None:
    """A rover that stands still sends nothing."""
    moving = [at(number * STEP_S) for number in range(21)]
    standing = [at(2.1 + number * STEP_S, speed=0.0) for number in range(50)]
    assert len(drive(*moving)) == 5
    assert len(drive(*standing)) == 0
    assert len(drive(*moving, *standing)) <= 6


def test_on_a_slope_the_position_advances_by_the_horizontal_part() -> None:
    """The distance is that along the slope."""
    pose = drive(*(at(number * STEP_S, pitch=0.3) for number in range(101)))[-1]
    assert pose.x_m / pose.distance_m == pytest.approx(math.cos(0.3))


def test_nothing_is_integrated_over_a_gap() -> None:
    """Five seconds without snapshots add no distance, and are counted."""
    pose = drive(at(0), at(0.5), at(5.5), at(6.0))[-1]
    assert pose.distance_m == pytest.approx(0.05)
    assert pose.gap_s == pytest.approx(5.0)


def test_without_sensors_the_wheels_give_the_distance_and_the_heading_stays() -> None:
    """The speed is r ω (1 − slip) over the wheels that were measured, and the heading is not measured."""
    steps = []
    for number in range(11):
        blind = at(number * STEP_S)
        values = blind.snapshot.values.copy()
        values[ROW[GROUND_SPEED]] = values[ROW[YAW_RATE]] = np.nan
        values[ROW[MOTOR_SPEED]] = 0.6 * CONFIGURATION.drivetrain.ratio
        values[ROW[MOTOR_SPEED]][4] = np.nan
        slip = np.full(6, 0.1)
        steps.append(replace(blind, slip=slip, snapshot=replace(blind.snapshot, values=values)))
    pose = drive(*steps)[-1]
    assert pose.speed_m_s == pytest.approx(0.6 * 0.9 * CONFIGURATION.wheel.radius_m)
    assert (pose.speed_source, pose.heading_source) == (SpeedSource.WHEEL_SPEED, HeadingSource.NONE)
    assert pose.y_m == 0


def test_unmeasured_snapshots_are_no_standstill() -> None:
    """A snapshot without any speed is left out, and the step after it is longer."""
    blind = at(0.5)
    values = np.full_like(blind.snapshot.values, np.nan)
    blind = replace(blind, snapshot=replace(blind.snapshot, values=values))
    assert drive(at(0), blind, at(1.0))[-1].distance_m == pytest.approx(0.05)
