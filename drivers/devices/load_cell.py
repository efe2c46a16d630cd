"""Load-cell amplifier (CiA 404, analogue input): the load on a wheel, in steps of 0.01 N."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import Device, Measured, PdoLayout, Quantity, Setting, Validity
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.virtual.device import VirtualDevice

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.measurement import Measurement

PROCESS_VALUE, STATUS = 0x9130, 0x6150  # sub-index 1: the first channel
OPERATING_MODE, UNIT, DECIMAL_DIGITS = 0x6112, 0x6131, 0x6132
LOWER_LIMIT, UPPER_LIMIT = 0x9148, 0x9149
NOT_VALID, POSITIVE_OVERLOAD, NEGATIVE_OVERLOAD = 0x01, 0x02, 0x04  # bits of 0x6150

_NEWTON = 0x0021_0000  # CiA 303-2
_NO_LIMIT = 1 << 31

LOAD = Quantity("load_N", "The load cell's reading.", noisy=True)


class VirtualLoadCell(VirtualDevice):
    """A virtual load-cell amplifier."""

    def measure(self, measurement: Measurement) -> None:
        """Put the load into its object (0x9130) and the overload bits into 0x6150."""
        dictionary = self.dictionary
        load = float(measurement.load_N[self.wheel or 0])
        place = self.places[LOAD.name]
        channel = place.subindex
        if not dictionary.get(OPERATING_MODE, channel, 1) or not math.isfinite(load):
            dictionary.put(STATUS, channel, NOT_VALID)
            return
        value = load / self.factor(place.scale)
        status = 0
        if value > dictionary.get(UPPER_LIMIT, channel, _NO_LIMIT):
            status = POSITIVE_OVERLOAD
        elif value < dictionary.get(LOWER_LIMIT, channel, -_NO_LIMIT):
            status = NEGATIVE_OVERLOAD
        dictionary.put(place.index, channel, value)
        dictionary.put(STATUS, channel, status)


LOAD_CELL = Device(
    kind="load-cell",
    configuration_key="load_cells",
    eds=EDS_FOLDER / "load-cell.eds",
    default_node_id=11,
    per_wheel=True,
    tpdos=(
        PdoLayout(
            1,
            (
                Measured(PROCESS_VALUE, 1, LOAD, 1e-2),
                Validity(STATUS, 1, NOT_VALID | POSITIVE_OVERLOAD | NEGATIVE_OVERLOAD),
            ),
        ),
    ),
    settings=(
        Setting(OPERATING_MODE, 1, 1),  # on
        Setting(UNIT, 1, _NEWTON),
        Setting(DECIMAL_DIGITS, 1, 2),  # 0.01 N
    ),
    virtual=VirtualLoadCell,
)
