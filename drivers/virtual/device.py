"""What a node is, behind its CANopen face: it measures, and may be told to do something."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.drivers.virtual.emcy import EmergencyProducer
    from regolithd.drivers.virtual.object_dictionary import Dictionary, Key
    from regolithd.drivers.virtual.plant import Measurement


class Device:
    """A device that does nothing; each kind of node tells what it does instead.

    `wheel` is 0–5, or None for what serves the whole body.
    """

    def __init__(self, dictionary: Dictionary, emergency: EmergencyProducer, wheel: int | None) -> None:
        self.dictionary = dictionary
        self.emergency = emergency
        self.wheel = wheel

    def reset(self) -> None:
        """Start anew, as after power-on."""

    def check(self, key: Key, value: int) -> None:
        """Raise `AbortError` where the device does not accept a value."""

    def written(self, key: Key, value: int) -> None:
        """Act on a value that an SDO or a PDO brought."""

    def advance(self, elapsed_s: float) -> None:
        """Let time pass."""

    def measure(self, measurement: Measurement) -> None:
        """Put what is measured into the object dictionary."""

    def connection_lost(self) -> None:
        """React to the master's silence, or to being stopped by it."""


class LoadCell(Device):
    """A load-cell amplifier (CiA 404): newtons times 10 to the decimal digits."""

    def measure(self, measurement: Measurement) -> None:
        """Put the load into 0x9130 and the overload bits into 0x6150."""
        dictionary = self.dictionary
        if not dictionary.get(0x6112, 1):  # channel switched off
            dictionary.put(0x6150, 1, 0x01)
            return
        load = float(measurement.load_N[self.wheel or 0])
        if not math.isfinite(load):
            dictionary.put(0x6150, 1, 0x01)
            return
        value = round(load * 10 ** dictionary.get(0x6132, 1))
        status = 0
        if value > dictionary.get(0x9149, 1):
            status = 0x02
        elif value < dictionary.get(0x9148, 1):
            status = 0x04
        dictionary.put(0x9130, 1, value)
        dictionary.put(0x6150, 1, status)


class Inclinometer(Device):
    """A two-axis inclinometer (CiA 410) with a yaw-rate gyroscope."""

    def measure(self, measurement: Measurement) -> None:
        """Put the slopes into 0x6010 and 0x6020 (in the configured resolution), the yaw rate into 0x2010."""
        step_deg = self.dictionary.get(0x6000) / 1000
        self.dictionary.put(0x6010, 0, round(math.degrees(measurement.pitch_rad) / step_deg))
        self.dictionary.put(0x6020, 0, round(math.degrees(measurement.roll_rad) / step_deg))
        self.dictionary.put(0x2010, 0, round(math.degrees(measurement.yaw_rate_rad_s) * 100))


class GroundSpeed(Device):
    """A velocimeter that sees the body's and each hub's speed over ground, in 0.01 mm/s."""

    def measure(self, measurement: Measurement) -> None:
        """Put the speeds into 0x2100 and 0x2101."""
        self.dictionary.put(0x2100, 0, round(measurement.ground_speed_m_s * 1e5))
        for wheel, speed in enumerate(measurement.hub_speed_m_s.tolist()):
            self.dictionary.put(0x2101, wheel + 1, round(speed * 1e5))
