"""The master's producers of SYNC and heartbeat, on a bus that fails."""

from __future__ import annotations

import asyncio
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rig import until

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import sync
from regolithd.drivers.canopen.heartbeat import produce_heartbeat
from regolithd.drivers.canopen.sync import RATE_LIMITS_Hz, SyncCounters, produce_sync
from regolithd.drivers.canopen.timer import Tick
from regolithd.drivers.errors import BusFullError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pytest


class FailingBus:
    """A bus that refuses every second frame."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    async def send(self, frame: Frame) -> None:
        """Keep a frame, and refuse it where its number is even."""
        self.frames.append(frame)
        if len(self.frames) % 2 == 0:
            raise BusFullError("vcan0: queue full")


class Ticks:
    """A timer with ticks that are known beforehand; after the last one it waits for ever."""

    def __init__(self, ticks: list[Tick]) -> None:
        self.ticks = iter(ticks)

    async def tick(self) -> Tick:
        """Return the next tick."""
        found = next(self.ticks, None)
        return found or await asyncio.get_running_loop().create_future()


async def test_a_heartbeat_that_cannot_be_sent_is_reported_and_the_next_one_follows() -> None:
    """The state operational is sent every period, and the callback is told of each success and failure."""
    bus, sent = FailingBus(), []
    task = asyncio.ensure_future(produce_heartbeat(bus, 127, 0.001, sent.append))
    await until(lambda: len(sent) >= 4, "four heartbeats")
    task.cancel()
    assert sent[:4] == [True, False, True, False]
    assert set(bus.frames) == {Frame(0, 0x77F, b"\x05")}


async def test_sent_failed_and_skipped_syncs_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skipped periods add up, a SYNC that cannot be sent counts as failed, and its lateness is left out."""
    periods = []

    @contextmanager
    def periodic(period_ns: int) -> Iterator[Ticks]:
        periods.append(period_ns)
        yield Ticks([Tick(100, 0), Tick(9_000, 2), Tick(300, 3)])

    monkeypatch.setattr(sync, "periodic", periodic)
    bus, counters = FailingBus(), SyncCounters()
    task = asyncio.ensure_future(produce_sync(bus, 40.0, counters))
    await until(lambda: len(bus.frames) == 3, "three SYNCs")
    task.cancel()
    assert periods == [25_000_000]
    assert set(bus.frames) == {Frame(0, 0x080, b"")}
    assert (counters.produced, counters.failed, counters.skipped) == (2, 1, 5)
    assert (counters.worst_late_ns, counters.mean_late_ns, counters.jitter_ns) == (300, 200.0, 100.0)


def test_a_producer_that_has_sent_nothing_has_no_jitter() -> None:
    """All counters start from 0, and SYNC rates from 1 to 200 Hz are allowed."""
    fresh = SyncCounters()
    assert (fresh.produced, fresh.skipped, fresh.failed, fresh.worst_late_ns) == (0, 0, 0, 0)
    assert (fresh.mean_late_ns, fresh.jitter_ns) == (0.0, 0.0)
    assert RATE_LIMITS_Hz == (1.0, 200.0)
