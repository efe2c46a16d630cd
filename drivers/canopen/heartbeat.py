"""The master's heartbeat producer (CiA 301, 7.2.8.3.2).

The drives consume it (0x1016) and stop the motors when it ends. It is therefore produced by the event loop that reads
the bus and commands the drives – never by a thread or the kernel, which would go on after the loop had hung.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.nmt import NmtState, state_frame
from regolithd.drivers.errors import BusError

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.can.bus import Bus


async def produce_heartbeat(bus: Bus, master_id: int, period_s: float, sent: Callable[[bool], None]) -> None:
    """Send the state operational every period, until cancelled; `sent` is called with whether it could be sent."""
    frame = state_frame(NmtState.OPERATIONAL, master_id)
    while True:
        try:
            await bus.send(frame)
        except BusError:
            sent(False)
        else:
            sent(True)
        await asyncio.sleep(period_s)
