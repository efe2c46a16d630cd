"""Dead reckoning: distance, position and heading from the speed over ground and the yaw rate of each snapshot.

    x ← x + v cos θ cos ψ Δt,   y ← y + v cos θ sin ψ Δt,   ψ ← ψ + ψ̇ Δt

with speed v, pitch θ and heading ψ (the mean of its values before and after). Where the hubs' speed is not measured,
v = r ω (1 − i). Where the yaw rate is not measured, the heading stays 0: the difference of the wheels' speeds is no
measure of it, because skid-steered wheels slide sideways.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from regolithd.drivers.devices.inclinometer import PITCH, YAW_RATE

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Array, Estimate, Snapshot

PERIOD_NS = 500_000_000
LONGEST_STEP_S = 2.0
"""A longer pause between two snapshots with measurements is a gap, over which nothing is integrated."""
STANDSTILL_M_S = 1e-4


class SpeedSource(StrEnum):
    """What the travelled distance is computed from."""

    GROUND_SPEED = "ground-speed"  # measured speed of the hubs over ground
    WHEEL_SPEED = "wheel-speed"  # wheel speed times radius times (1 − slip)


class HeadingSource(StrEnum):
    """What the heading is computed from."""

    YAW_RATE = "yaw-rate"  # the measured yaw rate, integrated
    NONE = "none"  # not measured: the heading stays 0


@dataclass(frozen=True, slots=True)
class Pose:
    """Dead-reckoned position and heading since the start; the fields of the `odometry` message."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    distance_m: float = 0.0
    speed_m_s: float = 0.0
    speed_source: SpeedSource = SpeedSource.WHEEL_SPEED
    heading_source: HeadingSource = HeadingSource.NONE
    gap_s: float = 0.0


class DeadReckoning:
    """Integrates the snapshots of one session, in order."""

    def __init__(self, configuration: Configuration) -> None:
        self._radius_m = configuration.wheel.radius_m
        self._ratio = configuration.drivetrain.ratio
        self._pose = Pose()
        self._last_ns: int | None = None
        self._reported_ns = 0
        self._moved = False

    def step(self, estimate: Estimate) -> Pose | None:
        """Return the pose when a half second has passed in which the rover moved, else None."""
        speed, source = self._speed(estimate)
        if not math.isfinite(speed):
            return None
        now_ns = estimate.snapshot.time_ns
        elapsed_s = 0.0 if self._last_ns is None else max(0.0, (now_ns - self._last_ns) / 1e9)
        self._last_ns = now_ns
        self._moved |= abs(speed) > STANDSTILL_M_S
        self._pose = _moved(self._pose, estimate.snapshot, speed, source, elapsed_s)
        if not self._moved or now_ns - self._reported_ns < PERIOD_NS:
            return None
        self._reported_ns, self._moved = now_ns, False
        return self._pose

    def _speed(self, estimate: Estimate) -> tuple[float, SpeedSource]:
        """Return the body's speed over ground [m/s], NaN where it is unknown, and its source."""
        measured = _mean(estimate.snapshot.ground_speed_m_s)
        if math.isfinite(measured):
            return measured, SpeedSource.GROUND_SPEED
        wheel_speed = estimate.snapshot.motor_speed_rad_s / self._ratio
        standing = np.isnan(estimate.slip)  # the slip of a wheel that stands still is undefined
        hub_speed = self._radius_m * wheel_speed * (1 - np.where(standing, 0.0, estimate.slip))
        return _mean(hub_speed), SpeedSource.WHEEL_SPEED


def _moved(pose: Pose, snapshot: Snapshot, speed_m_s: float, source: SpeedSource, elapsed_s: float) -> Pose:
    """Return the pose after a step at constant speed, pitch and yaw rate."""
    pitch, yaw_rate = float(snapshot[PITCH][0]), float(snapshot[YAW_RATE][0])
    measured = math.isfinite(yaw_rate)
    gap = elapsed_s > LONGEST_STEP_S
    step_s = 0.0 if gap else elapsed_s
    turned = yaw_rate * step_s if measured else 0.0
    way = speed_m_s * step_s
    level = way * math.cos(pitch) if math.isfinite(pitch) else way
    direction = pose.heading_rad + turned / 2
    return Pose(
        x_m=pose.x_m + level * math.cos(direction),
        y_m=pose.y_m + level * math.sin(direction),
        heading_rad=pose.heading_rad + turned,
        distance_m=pose.distance_m + abs(way),
        speed_m_s=speed_m_s,
        speed_source=source,
        heading_source=HeadingSource.YAW_RATE if measured else HeadingSource.NONE,
        gap_s=pose.gap_s + (elapsed_s if gap else 0.0),
    )


def _mean(values: Array) -> float:
    """Return the mean of the finite values, NaN if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else math.nan
