"""The units that one node states, as the decoder learns them: from the answers to SDO reads that pass on the bus.

The master reads them while the node boots. That the decoder takes them from the frames keeps it a pure function of the
frames: a replayed log gives the numbers that the bus gave. A recording that is continued in another file repeats
these frames at its start.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from regolithd.drivers.devices.units import StatedUnit, UnknownUnitError, stated_factor

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.device import Device
    from regolithd.drivers.devices.units import ObjectKey, Scale

_UPLOADED = 0x43  # answer to an SDO upload, expedited, with its size given (CiA 301, 7.2.4.3.6)
_UNUSED_BYTES = 0x0C
_ANSWER = struct.Struct("<BHB4s")


class StatedUnits:
    """The values of a node's unit objects; `on_change` is called with `factor` once they change."""

    def __init__(self, device: Device) -> None:
        self._wanted = frozenset(device.stated_units)
        self._values: dict[ObjectKey, int] = {}
        self._on_change: list[Callable[[], None]] = []
        self.frames: dict[ObjectKey, Frame] = {}

    def __bool__(self) -> bool:
        return bool(self._wanted)

    def notify(self, on_change: Callable[[], None]) -> None:
        """Call a function each time a value changes."""
        self._on_change.append(on_change)

    def factor(self, scale: Scale) -> float | None:
        """Return the factor of a unit, or None while the device has not stated it."""
        if not isinstance(scale, StatedUnit):
            return scale
        try:
            return stated_factor(scale, tuple(self._values[key] for key in scale.objects))
        except (KeyError, UnknownUnitError):
            return None

    def take(self, frame: Frame) -> None:
        """Take an answer of the node's SDO server."""
        if len(frame.data) != _ANSWER.size:
            return
        command, index, subindex, data = _ANSWER.unpack(frame.data)
        key = (index, subindex)
        if key not in self._wanted or command & ~_UNUSED_BYTES != _UPLOADED:
            return
        value = int.from_bytes(data[: 4 - (command >> 2 & 3)], "little")
        self.frames[key] = frame
        if self._values.get(key) != value:
            self._values[key] = value
            for each in self._on_change:
                each()
