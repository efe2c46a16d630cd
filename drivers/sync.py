"""The SYNC producer (CiA 301, 7.2.5): one frame on 0x080 per period, on a schedule that does not drift.

The n-th SYNC is due at start + n·period, whatever became of those before. asyncio's timers wake up to 1 ms late (epoll
counts whole milliseconds); the lateness is measured. A snapshot's time is not the schedule's: it is the kernel's time
of the SYNC's echo.
"""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.decode import SYNC_COB_ID
from drivers.errors import BusError
from drivers.frame import Frame

if TYPE_CHECKING:
    from drivers.bus import Bus

SYNC_FRAME = Frame(0, SYNC_COB_ID, b"")
RATE_LIMITS_Hz = (1.0, 200.0)


@dataclass(slots=True)
class SyncCounters:
    """How the producer keeps its time: how many, and how late against the schedule [ns]."""

    produced: int = 0
    skipped: int = 0  # the loop was late by a whole period: left out, never sent in a burst
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


class Schedule:
    """Due times of a periodic action on a monotonic clock [s]."""

    def __init__(self, start: float, period: float) -> None:
        self._start = start
        self._period = period
        self._number = 0

    def following(self, now: float) -> tuple[float, int]:
        """Return when the next one is due, and how many whole periods had to be left out because `now` is past them."""
        self._number += 1
        missed = max(0, math.floor((now - self._start) / self._period) - self._number)
        self._number += missed
        return self._start + self._number * self._period, missed


async def produce_sync(bus: Bus, rate_Hz: float, counters: SyncCounters) -> None:
    """Send a SYNC at this rate until cancelled; one that cannot be sent is counted, and the schedule goes on."""
    loop = asyncio.get_running_loop()
    schedule = Schedule(loop.time(), 1.0 / rate_Hz)
    while True:
        due, missed = schedule.following(loop.time())
        counters.skipped += missed
        await asyncio.sleep(due - loop.time())
        late_s = loop.time() - due
        try:
            await bus.send(SYNC_FRAME)
        except BusError:
            counters.failed += 1
        else:
            counters.count(round(late_s * 1e9))
