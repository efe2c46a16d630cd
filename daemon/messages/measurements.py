"""The messages of one SYNC: `snapshot` (all wheels, as lists of six) and `wheel/…` (one wheel, as plain values)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from regolithd.daemon.messages.header import Header, WheelNumber
from regolithd.daemon.pipeline.snapshot import SlipSource

SixNumbers = Annotated[tuple[float | None, ...], Field(min_length=6, max_length=6)]
SixIntegers = Annotated[tuple[int | None, ...], Field(min_length=6, max_length=6)]
SixFlags = Annotated[tuple[bool, ...], Field(min_length=6, max_length=6)]
SixSources = Annotated[tuple[SlipSource, ...], Field(min_length=6, max_length=6)]
SixNameLists = Annotated[tuple[tuple[str, ...], ...], Field(min_length=6, max_length=6)]


class SnapshotMessage(Header):
    """All measurements of one SYNC, of the six wheels and the body, and the estimates made from them."""

    model_version: str
    """Version of the terrain network."""
    pitch_rad: float | None
    """Positive nose up."""
    roll_rad: float | None
    """Positive right side down."""
    yaw_rate_rad_s: float | None
    """Positive to the left."""
    measured: SixFlags
    """Where current, speed and load all arrived."""
    valid: SixFlags
    """Where an estimate could be made."""
    motor_current_A: SixNumbers
    """At the motor, signed."""
    motor_speed_rad_s: SixNumbers
    """At the motor, before the gears, signed."""
    load_N: SixNumbers
    """The load cell's reading."""
    ground_speed_m_s: SixNumbers
    """Speed of the wheel's hub over ground."""
    motor_temperature_degC: SixNumbers
    bus_voltage_V: SixNumbers
    """Supply voltage at the motor controller."""
    statusword: SixIntegers
    """Object 0x6041 of the motor controller."""
    wheel_torque_Nm: SixNumbers
    """At the wheel, by Eq. 11, before smoothing."""
    smoothed_torque_Nm: SixNumbers
    """After the filter that removes momentary current drops."""
    smoothed_load_N: SixNumbers
    slip: SixNumbers
    """i = 1 − V/(r ω)."""
    slip_source: SixSources
    """Measured, the configured constant, or none because the wheel stands still."""
    cohesion_Pa: SixNumbers
    friction_angle_rad: SixNumbers
    outside_training_range: SixNameLists
    """The terrain network's inputs that lie outside its training range; the estimate of such a wheel is unreliable."""


class WheelMessage(Header):
    """The measurements and estimates of one wheel at one SYNC: the values that `snapshot` has as lists of six."""

    model_version: str
    wheel: WheelNumber
    measured: bool
    valid: bool
    motor_current_A: float | None
    motor_speed_rad_s: float | None
    load_N: float | None
    ground_speed_m_s: float | None
    motor_temperature_degC: float | None
    bus_voltage_V: float | None
    statusword: int | None
    wheel_torque_Nm: float | None
    smoothed_torque_Nm: float | None
    smoothed_load_N: float | None
    slip: float | None
    slip_source: SlipSource
    cohesion_Pa: float | None
    friction_angle_rad: float | None
    outside_training_range: tuple[str, ...]
