"""An open CAN bus for asyncio: frames received in batches, sent one by one, all counted.

    async with open_bus("socketcan", "can0") as bus:
        await bus.send(sync_frame)
        async for batch in bus:
            for frame in batch: …

SocketCAN is read by `drivers.can.socketcan`: one system call returns up to 64 frames, with kernel times and drop
counter. Every other interface of python-can is read by one thread (`drivers.can.python_can_bus`).

An empty batch means that `bus.state` changed. The iteration ends only by cancellation: a link that goes down and comes
up again changes the state and does not end it.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from regolithd.drivers.can.counters import BusCounters

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame


READ_WITHIN_S = 0.05
"""Time in which frames that wait in the socket are read, once this program runs. Until then it was late itself, and no
node can be told to be silent: a time that waits for a node's frame is over only when this time is over as well."""
_MOST_PENDING = 20_000  # frames: two seconds of a full bus


class BusState(StrEnum):
    """The controller's error state (ISO 11898-1), or that the link is down."""

    ACTIVE = "active"
    WARNING = "warning"  # an error counter passed 96
    PASSIVE = "passive"  # an error counter passed 127
    OFF = "bus-off"  # the transmit error counter passed 255: the controller took itself off the bus
    DOWN = "down"  # the link is down, or the adapter is gone


class Bus(ABC):
    """An open bus. One task iterates it; any task may send."""

    def __init__(self, interface: str, channel: str) -> None:
        self.interface = interface
        self.channel = channel
        self.counters = BusCounters()
        self.state = BusState.ACTIVE
        self._pending: list[Frame] = []
        self._arrived = asyncio.Event()
        self._paused = False

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> list[Frame]:
        return await self.receive()

    async def receive(self) -> list[Frame]:
        """Return what has arrived since the last call, in order; wait if nothing has. Empty: `state` changed.

        Cancelling it loses nothing.
        """
        await self._arrived.wait()
        self._arrived.clear()
        batch, self._pending = self._pending, []
        if self._paused:
            self._paused = False
            self.resume_reading()
        return batch

    @abstractmethod
    async def send(self, frame: Frame) -> None:
        """Send a frame (its `time_ns` is ignored); its echo, with the kernel's time, comes back with `sent` set.

        A full transmit queue is retried for a bounded time.

        Raises
        ------
        BusDownError
            The link is down or the adapter is gone.
        BusFullError
            The transmit queue stayed full.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the bus; pending frames are lost."""

    # For implementations of a bus

    @abstractmethod
    def pause_reading(self) -> None:
        """Stop reading, because the consumer is too slow; frames stay in the kernel or the adapter."""

    @abstractmethod
    def resume_reading(self) -> None:
        """Resume reading after the consumer has caught up."""

    def deliver(self, frames: list[Frame]) -> None:
        """Count frames that were read, and pass them to `receive`."""
        counters = self.counters
        counters.batches += 1
        counters.largest_batch = max(counters.largest_batch, len(frames))
        echoed = sum([frame.sent for frame in frames])
        counters.echoed += echoed
        counters.received += len(frames) - echoed
        self._pending += frames
        self._arrived.set()
        if len(self._pending) > _MOST_PENDING and not self._paused:
            self._paused = True
            self.pause_reading()

    def change_state(self, state: BusState) -> None:
        """Set the controller's or the link's state, count it, and wake `receive`."""
        if state is self.state:
            return
        self.state = state
        self.counters.bus_off += state is BusState.OFF
        self.counters.link_down += state is BusState.DOWN
        self._arrived.set()
