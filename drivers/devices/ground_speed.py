"""Ground-speed sensor on the body (manufacturer-specific objects): speed over ground, in steps of 0.01 mm/s."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import Device, Measured, PdoLayout, Quantity, Validity
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.virtual.device import VirtualDevice

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.measurement import Measurement

BODY_SPEED, HUB_SPEEDS, STATUS = 0x2100, 0x2101, 0x2102

GROUND_SPEED = Quantity("ground_speed_m_s", "Speed of the wheel's hub over ground.")
"""Per wheel: what the one sensor of the body measures holds for all six hubs."""


class VirtualGroundSpeedSensor(VirtualDevice):
    """A virtual sensor of the body's and each hub's speed over ground."""

    def measure(self, measurement: Measurement) -> None:
        """Put the speeds into 0x2100 and 0x2101."""
        self.dictionary.put(BODY_SPEED, 0, round(measurement.ground_speed_m_s * 1e5))
        for wheel, speed in enumerate(measurement.hub_speed_m_s.tolist()):
            self.dictionary.put(HUB_SPEEDS, wheel + 1, round(speed * 1e5))


GROUND_SPEED_SENSOR = Device(
    kind="ground-speed",
    configuration_key="ground_speed",
    eds=EDS_FOLDER / "ground-speed.eds",
    default_node_id=22,
    tpdos=(PdoLayout(1, (Measured(BODY_SPEED, 0, GROUND_SPEED, 1e-5), Validity(STATUS, 0, 0b1))),),
    virtual=VirtualGroundSpeedSensor,
)
