"""Opens a bus: chooses the implementation by the interface's name."""

from __future__ import annotations

from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from regolithd.drivers.can.bus import Bus


@asynccontextmanager
async def open_bus(interface: str, channel: str, *, bitrate: int | None = None) -> AsyncIterator[Bus]:
    """Open `channel` of any python-can interface (`socketcan`, `virtual`, `slcan`, …) until the end of the context.

    `bitrate` (bit/s) is for adapters that set it themselves; a SocketCAN link gets its own when it is brought up.

    Raises
    ------
    BusOpenError
        It cannot be opened; the message says why and what to do.
    """
    bus: Bus
    if interface == "socketcan":
        from regolithd.drivers.can.socketcan import SocketCanBus  # noqa: PLC0415  # Linux only; `virtual` works on every system

        bus = SocketCanBus(channel)
    else:
        from regolithd.drivers.can.python_can_bus import PythonCanBus  # noqa: PLC0415  # likewise: not needed for SocketCAN

        bus = PythonCanBus(interface, channel, bitrate=bitrate)
    try:
        yield bus
    finally:
        bus.close()
