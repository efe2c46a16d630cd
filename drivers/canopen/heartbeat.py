"""Heartbeats (CiA 301, 7.2.8.3.2): the master's own, and the judgement on the nodes'.

The drives hear the master's (0x1016) and stop the motors when it ends. It is therefore produced by the same event loop
that reads and commands – never by a thread or the kernel, which would go on after the loop had hung.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.nmt import NmtState, state_frame
from regolithd.drivers.errors import BusError

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.master.remote_node import Link

# After a deadline has passed, frames may still lie in the socket because this program itself was late: a node is lost
# only when it stays silent while we verifiably read on.
_GRACE_S = 0.05


async def produce_heartbeat(bus: Bus, master_id: int, period_s: float, sent: Callable[[bool], None]) -> None:
    """Say that the master is operational, every period, until cancelled; `sent` hears whether it could be said."""
    frame = state_frame(NmtState.OPERATIONAL, master_id)
    while True:
        try:
            await bus.send(frame)
        except BusError:
            sent(False)
        else:
            sent(True)
        await asyncio.sleep(period_s)


@dataclass(frozen=True, slots=True)
class Loss:
    """How an operational node was lost; `silent`: it is not heard any more, so there is nobody to boot."""

    text: str
    silent: bool


async def until_lost(link: Link, lost_after_s: float) -> Loss:
    """Wait until an operational node is so no more, and return what happened to it."""
    boot_ups = link.boot_ups
    while True:
        if not await _heard_within(link, lost_after_s) and not await _heard_within(link, _GRACE_S):
            return Loss(f"no heartbeat for {lost_after_s:g} s", silent=True)
        if link.boot_ups > boot_ups:
            return Loss("it restarted by itself", silent=False)
        if link.state is not NmtState.OPERATIONAL:
            return Loss(f"it left operational and says {link.state.words if link.state else 'nothing'}", silent=False)


async def _heard_within(link: Link, time_s: float) -> bool:
    before = link.heard
    return await link.news.until(lambda: link.heard > before, time_s)
