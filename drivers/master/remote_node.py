"""One node as its master sees it: what it last said of itself, and how to talk to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.canopen.decoder import SDO_ANSWER_COB_ID
from regolithd.drivers.canopen.nmt import ERROR_CONTROL_COB_ID, NmtCommand, NmtState, command_frame, parse_state
from regolithd.drivers.canopen.sdo_client import SdoClient
from regolithd.drivers.condition import Watch

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.signals import NodeDescription


class Link:
    """The conversation with one node. Whoever reads the bus passes its frames on; anyone may wait on `news`."""

    def __init__(self, bus: Bus, node: NodeDescription, *, sdo_timeout_s: float) -> None:
        self.node = node
        self.sdo = SdoClient(bus, node.node_id, timeout_s=sdo_timeout_s)
        self.news = Watch()
        self.state: NmtState | None = None
        self.heard_ns: int | None = None
        self.heard = 0  # heartbeats and boot-ups so far
        self.boot_ups = 0
        self._bus = bus

    @property
    def handlers(self) -> dict[int, Callable[[Frame], None]]:
        """What takes the frames of its SDO server and of its error control, by COB-ID."""
        node_id = self.node.node_id
        return {
            SDO_ANSWER_COB_ID + node_id: self.sdo.handle,
            ERROR_CONTROL_COB_ID + node_id: self._take_state,
        }

    async def tell(self, command: NmtCommand) -> None:
        """Send an NMT command to the node."""
        await self._bus.send(command_frame(command, self.node.node_id))

    def _take_state(self, frame: Frame) -> None:
        """Take a heartbeat or boot-up message; one that says no state of CiA 301 is none."""
        state = parse_state(frame.data)
        if state is None:
            return
        self.heard += 1
        self.heard_ns = frame.time_ns
        booted = state is NmtState.BOOT_UP
        if booted:
            self.boot_ups += 1
            self.sdo.interrupt()
        self.state = NmtState.PRE_OPERATIONAL if booted else state
        self.news.notify()
