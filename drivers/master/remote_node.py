"""The master's view of one node: its NMT state, and its SDO client."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.nmt import NmtCommand, NmtState, command_frame
from regolithd.drivers.canopen.sdo_client import SdoClient
from regolithd.drivers.devices.device import Commanded, Measured
from regolithd.drivers.devices.units import StatedUnit, UnknownUnitError, stated_factor
from regolithd.drivers.master.condition import Condition

if TYPE_CHECKING:
    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.devices.decoding.signals import NodeState
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.devices.units import ObjectKey, Scale


class RemoteNode:
    """A node on the bus: what it has reported, its SDO client, and NMT commands.

    The reader of the bus passes its heartbeats to `take_state` and its SDO answers (`answer_cob_id`) to `sdo.handle`.

    Attributes
    ----------
    state
        NMT state that it last reported; None before the first heartbeat.
    heard_ns, heard_s, heard
        Kernel's time and monotonic time of its last heartbeat or boot-up message, and their number.
    boot_ups
        Number of its boot-up messages.
    changed
        Notified at each heartbeat and boot-up message, and at the end of each boot.
    state_changed
        Notified at each boot-up message, and at each heartbeat with another state than the last.
    stated
        Values of the objects in which the device states its units, as read during its last boot.
    """

    def __init__(self, bus: Bus, node: NodeDescription, *, sdo_timeout_s: float) -> None:
        self.node = node
        self.sdo = SdoClient(bus, node.node_id, timeout_s=sdo_timeout_s)
        self.changed = Condition()
        self.state_changed = Condition()
        self.state: NmtState | None = None
        self.heard_ns: int | None = None
        self.heard = 0
        self.heard_s = time.monotonic()
        self.boot_ups = 0
        self.stated: dict[ObjectKey, int] = {}
        self._bus = bus

    @property
    def answer_cob_id(self) -> int:
        """COB-ID of the answers of its SDO server."""
        return cob_id.SDO_ANSWER + self.node.node_id

    def factor(self, scale: Scale) -> float:
        """Return the factor of an object's raw value to SI.

        Raises
        ------
        UnknownUnitError
            The device states no plausible unit; or it has not been booted, and nothing is known.
        """
        if not isinstance(scale, StatedUnit):
            return scale
        if any(key not in self.stated for key in scale.objects):
            raise UnknownUnitError(f"the objects of its unit ({scale.name}) have not been read")
        return stated_factor(scale, tuple(self.stated[key] for key in scale.objects))

    def check_units(self) -> None:
        """Raise `UnknownUnitError` where a unit that the device states cannot be used."""
        device = self.node.device
        for layout in (*device.tpdos, *device.rpdos):
            for each in layout.objects:
                if isinstance(each, Measured | Commanded):
                    self.factor(each.scale)

    async def send_command(self, command: NmtCommand) -> None:
        """Send an NMT command to the node."""
        await self._bus.send(command_frame(command, self.node.node_id))

    def take_state(self, report: NodeState) -> None:
        """Take a heartbeat or boot-up message."""
        self.heard += 1
        self.heard_ns = report.time_ns
        self.heard_s = time.monotonic()
        booted = report.state is NmtState.BOOT_UP
        if booted:
            self.boot_ups += 1
            self.sdo.interrupt()
        state = NmtState.PRE_OPERATIONAL if booted else report.state
        changed, self.state = booted or state is not self.state, state
        self.changed.notify()
        if changed:
            self.state_changed.notify()
