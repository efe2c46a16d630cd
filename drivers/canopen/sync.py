"""The SYNC producer (CiA 301, 7.2.5): one frame on 0x080 per period, on a schedule that does not drift.

The n-th SYNC is due at start + n·period, however late earlier ones were (`canopen.timer`); the lateness of each is
measured. A snapshot's time is the kernel's receive time of the SYNC's echo, not the scheduled one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.timer import periodic
from regolithd.drivers.errors import BusError

if TYPE_CHECKING:
    from regolithd.drivers.can.bus import Bus

SYNC_FRAME = Frame(0, cob_id.SYNC, b"")
RATE_LIMITS_Hz = (1.0, 200.0)


@dataclass(slots=True)
class SyncCounters:
    """Number of SYNCs, and their lateness against the schedule [ns]."""

    produced: int = 0
    skipped: int = 0  # the event loop was late by a whole period: skipped, not sent in a burst
    failed: int = 0  # could not be sent: link down or queue full
    worst_late_ns: int = 0
    mean_late_ns: float = 0.0
    _squares: float = 0.0

    @property
    def jitter_ns(self) -> float:
        """Standard deviation of the lateness [ns]."""
        return math.sqrt(self._squares / self.produced) if self.produced else 0.0

    def count(self, late_ns: int) -> None:
        """Count a SYNC that was sent, by Welford's running mean and sum of squares."""
        self.produced += 1
        self.worst_late_ns = max(self.worst_late_ns, late_ns)
        before = late_ns - self.mean_late_ns
        self.mean_late_ns += before / self.produced
        self._squares += before * (late_ns - self.mean_late_ns)


async def produce_sync(bus: Bus, rate_Hz: float, counters: SyncCounters) -> None:
    """Send a SYNC at this rate until cancelled; one that cannot be sent is counted and skipped."""
    with periodic(round(1e9 / rate_Hz)) as timer:
        while True:
            tick = await timer.tick()
            counters.skipped += tick.missed
            try:
                await bus.send(SYNC_FRAME)
            except BusError:
                counters.failed += 1
            else:
                counters.count(tick.late_ns)
