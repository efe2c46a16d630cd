"""An MQTT broker (amqtt) inside the demo's process; on a rover the broker is mosquitto."""

from __future__ import annotations

import asyncio
import logging
import socket
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asyncio import StreamReader, StreamWriter
    from collections.abc import AsyncIterator

_UNACCEPTABLE_PROTOCOL_VERSION = b"\x20\x02\x00\x01"
"""CONNACK with return code 1 (MQTT 3.1.1, 3.2.2.3)."""
_MQTT_3_1_1 = 4
"""Protocol level (3.1.2.2)."""


async def _start_of_connect(reader: StreamReader) -> tuple[bytes, int]:
    """Return a CONNECT's bytes up to the protocol level, and that level (MQTT 3.1.1, 2.2 and 3.1.2)."""
    start = await reader.readexactly(2)
    while start[-1] & 0x80:  # the remaining length goes on
        start += await reader.readexactly(1)
    start += await reader.readexactly(len(b"\x00\x04MQTT") + 1)
    return start, start[-1]


class _ReadAgain:
    """A stream of which the first bytes were read already: it gives them once more."""

    def __init__(self, start: bytes, reader: StreamReader) -> None:
        self._start, self._reader = start, reader

    async def readexactly(self, count: int) -> bytes:
        """Return so many bytes."""
        first, self._start = self._start[:count], self._start[count:]
        return first + await self._reader.readexactly(count - len(first))

    async def read(self, count: int = -1) -> bytes:
        """Return so many bytes at most; -1: all until the end."""
        if not self._start:
            return await self._reader.read(count)
        if count < 0:
            first, self._start = self._start, b""
            return first + await self._reader.read()
        first, self._start = self._start[:count], self._start[count:]
        return first

    def feed_eof(self) -> None:
        """Mark the end."""
        self._reader.feed_eof()


@asynccontextmanager
async def embedded_broker() -> AsyncIterator[int]:
    """Run a broker on a free port of the loopback interface while the context lasts; yield the port."""
    from amqtt.broker import Broker  # noqa: PLC0415  # an optional dependency, and slow to import

    class Mqtt311Broker(Broker):  # type: ignore[misc]  # amqtt has no types
        """Refuses a CONNECT of MQTT 5 as the standard says: amqtt takes its properties for a will, and waits."""

        async def stream_connected(self, reader: StreamReader, writer: StreamWriter, listener_name: str) -> None:
            """Serve a client of MQTT 3.1.1; tell another one which version there is."""
            with suppress(asyncio.IncompleteReadError):
                start, level = await _start_of_connect(reader)
                if level == _MQTT_3_1_1:
                    return await super().stream_connected(_ReadAgain(start, reader), writer, listener_name)
            writer.write(_UNACCEPTABLE_PROTOCOL_VERSION)
            writer.close()
            return None

    logging.getLogger("amqtt").setLevel(logging.ERROR)
    logging.getLogger("transitions").setLevel(logging.ERROR)
    port = _free_port()
    broker = Mqtt311Broker(
        {
            "listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}},
            "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
        }
    )
    await broker.start()
    try:
        yield port
    finally:
        await broker.shutdown()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
