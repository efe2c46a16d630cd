"""Every kind of device that can be on the bus: to add one, write its file beside this one and add its line here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.devices.ground_speed import GROUND_SPEED, GROUND_SPEED_SENSOR
from regolithd.drivers.devices.inclinometer import INCLINOMETER, PITCH, ROLL, YAW_RATE
from regolithd.drivers.devices.load_cell import LOAD, LOAD_CELL
from regolithd.drivers.devices.motor_controller import (
    BUS_VOLTAGE,
    MOTOR_CONTROLLER,
    MOTOR_CURRENT,
    MOTOR_SPEED,
    MOTOR_TEMPERATURE,
    STATUSWORD,
)

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device, Quantity

DEVICES: tuple[Device, ...] = (
    MOTOR_CONTROLLER,
    LOAD_CELL,
    INCLINOMETER,
    GROUND_SPEED_SENSOR,
)

_FIRST = (
    *(MOTOR_CURRENT, MOTOR_SPEED, LOAD, GROUND_SPEED, PITCH, ROLL, YAW_RATE),
    *(MOTOR_TEMPERATURE, BUS_VOLTAGE, STATUSWORD),
)
"""The rows that snapshots have always had, in that order: replay digests depend on it."""

QUANTITIES: tuple[Quantity, ...] = (
    *_FIRST,
    *(quantity for device in DEVICES for quantity in device.quantities if quantity not in _FIRST),
)
"""Every measured quantity, in the order of a snapshot's rows; those of added devices come last."""
