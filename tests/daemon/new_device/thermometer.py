"""Resistance thermometer on the body (CiA 404, analogue input): ambient temperature, in steps of 0.01 °C."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import Device, Measured, PdoLayout, Quantity, Validity
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.virtual.device import VirtualDevice

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.measurement import Measurement

AMBIENT_TEMPERATURE = Quantity("ambient_temperature_degC", "In the shade of the body.", per_wheel=False)


class VirtualThermometer(VirtualDevice):
    """A virtual thermometer at a constant temperature."""

    def measure(self, measurement: Measurement) -> None:
        """Put −7.25 °C into 0x9130."""
        del measurement
        self.dictionary.put(0x9130, 1, -725)
        self.dictionary.put(0x6150, 1, 0)


THERMOMETER = Device(
    kind="thermometer",
    configuration_key="thermometer",
    eds=EDS_FOLDER / "load-cell.eds",  # the same amplifier, with a resistor at its input
    default_node_id=31,
    tpdos=(PdoLayout(1, (Measured(0x9130, 1, AMBIENT_TEMPERATURE, 1e-2), Validity(0x6150, 1, 0b111))),),
    virtual=VirtualThermometer,
)
