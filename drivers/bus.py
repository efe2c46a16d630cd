"""One CAN bus, opened for an asyncio program: batches of frames in, frames out, everything counted.

    async with open_bus("socketcan", "can0") as bus:
        await bus.send(sync_frame)
        async for batch in bus:
            for frame in batch: …

SocketCAN is read by ourselves (`drivers.socketcan`: one system call brings up to 64 frames, with kernel times and drop
counter). Every other interface of python-can goes through one thread (`drivers.adapter`).

An empty batch says that `bus.state` changed. The iteration ends only by cancellation: a link that goes down and comes
up again is a state of the bus, never the end of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import asynccontextmanager
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from drivers.counters import BusCounters

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from drivers.frame import Frame


class BusState(StrEnum):
    """The controller's error state (ISO 11898-1), or that there is no link at all."""

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

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> list[Frame]:
        return await self.receive()

    @abstractmethod
    async def receive(self) -> list[Frame]:
        """Return what has arrived since the last call, in order; wait if nothing has. Empty: `state` changed."""

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
        """Give the bus back; pending frames are lost."""


@asynccontextmanager
async def open_bus(interface: str, channel: str, *, bitrate: int | None = None) -> AsyncIterator[Bus]:
    """Open `channel` of any python-can interface (`socketcan`, `virtual`, `slcan`, …) for the time of the context.

    `bitrate` (bit/s) is for adapters that set it themselves; a SocketCAN link gets its own when it is brought up.

    Raises
    ------
    BusOpenError
        It cannot be opened; the message says why and what to do.
    """
    bus: Bus
    if interface == "socketcan":
        from drivers.socketcan import SocketCanBus  # noqa: PLC0415  # Linux only: `virtual` works anywhere

        bus = SocketCanBus(channel)
    else:
        from drivers.adapter import AdapterBus  # noqa: PLC0415  # likewise: not where the kernel does it all

        bus = AdapterBus(interface, channel, bitrate=bitrate)
    try:
        yield bus
    finally:
        bus.close()
