"""One node as its master sees it: what it last said of itself, and how to talk to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.nmt import NmtCommand, NmtState, command_frame
from drivers.sdo_client import SdoClient
from drivers.watch import Watch

if TYPE_CHECKING:
    from drivers.bus import Bus
    from drivers.signals import NodeDescription, NodeState


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

    async def tell(self, command: NmtCommand) -> None:
        """Send an NMT command to the node."""
        await self._bus.send(command_frame(command, self.node.node_id))

    def take_state(self, signal: NodeState) -> None:
        """Take a heartbeat or boot-up message of the node."""
        self.heard += 1
        self.heard_ns = signal.time_ns
        booted = signal.state is NmtState.BOOT_UP
        self.boot_ups += booted
        self.state = NmtState.PRE_OPERATIONAL if booted else signal.state
        self.news.notify()
