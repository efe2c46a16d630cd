"""What is fuzzed over a connection: the control socket by a client, the publisher by a hostile broker."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import struct
from contextlib import suppress
from typing import TYPE_CHECKING

from estimates import estimate
from targets import Target, WrongExitError

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.control.server import ControlSink
from regolithd.daemon.publish.backoff import Backoff
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

CLIENTS = 20
LINES = (
    b'{"command":"status"}\n',
    b'{"command":"stop","quick":false}\n',
    b'{"command":"trav',
    b"\n",
    b"[" * 5000 + b"\n",
)
CONNACK, PUBACK = b"\x20\x02\x00\x00", 0x40
BROKER_S = 1.0


def control_socket(random: Random, folder: Path) -> None:
    """Clients write anything to the control socket; afterwards `status` is answered."""
    asyncio.run(_control_socket(random, folder))


async def _control_socket(random: Random, folder: Path) -> None:
    path = folder / "control.sock"
    sink = ControlSink(
        Configuration.model_validate({"control": {"socket": path, "group": str(os.getgid())}}), lambda: None
    )
    serving = asyncio.create_task(sink.run())
    while not path.exists():  # noqa: ASYNC110
        await asyncio.sleep(0.005)
    for _ in range(CLIENTS):
        reader, writer = await asyncio.open_unix_connection(str(path))
        with suppress(ConnectionError):
            for _ in range(random.randrange(5)):
                noise = random.randbytes(random.randrange(200))
                writer.write(random.choice((*LINES, noise, noise + b"\n", b"x" * 200_000)))
                await writer.drain()
        if random.random() < 0.5:
            writer.close()
        del reader
    reader, writer = await asyncio.open_unix_connection(str(path))
    writer.write(LINES[0])
    async with asyncio.timeout(5):
        answer = await reader.readline()
    if b'"status"' not in answer:
        raise WrongExitError(f"no status after the noise: {answer!r}")
    writer.close()
    serving.cancel()
    with suppress(asyncio.CancelledError):
        await serving


def hostile_broker(random: Random, folder: Path) -> None:
    """A broker that accepts, and then says anything: the publisher takes every estimate, and ends when told."""
    log = logging.getLogger("regolithd")
    log.setLevel(logging.CRITICAL)
    try:
        asyncio.run(_hostile_broker(random, folder))
    finally:
        log.setLevel(logging.NOTSET)


async def _hostile_broker(random: Random, folder: Path) -> None:
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError, asyncio.IncompleteReadError):
            if random.random() < 0.8:
                await reader.read(500)
                writer.write(CONNACK)
            for _ in range(random.randrange(30)):
                writer.write(_packet(random))
                await writer.drain()
                await asyncio.sleep(random.choice((0, 0, 0.02)))
            if random.random() < 0.5:
                writer.transport.abort()

    server = await asyncio.start_server(serve, "127.0.0.1", 0, family=socket.AF_INET)
    port = server.sockets[0].getsockname()[1]
    settings = {"host": "127.0.0.1", "port": port, "spool_directory": folder / "spool", "keepalive_s": 2}
    stores = Stores.open(folder / "spool", 1_000_000)
    publisher = Publisher(Configuration.model_validate({"mqtt": settings}), stores, backoff=Backoff(0.01, 0.05))
    running = asyncio.create_task(publisher.run())
    for sequence in range(int(BROKER_S * 50)):
        publisher.estimate(estimate(sequence))
        await asyncio.sleep(0.02)
        if running.done():
            running.result()
    if publisher.report.queued + publisher.report.acknowledged + publisher.report.dropped < BROKER_S * 50:
        raise WrongExitError(f"estimates were lost: {publisher.report}")
    running.cancel()
    async with asyncio.timeout(5):
        with suppress(asyncio.CancelledError):
            await running
    server.close()
    stores.close()


def _packet(random: Random) -> bytes:
    """Return an MQTT packet: acknowledgements of anything, publishes, wrong lengths, noise."""
    match random.randrange(6):
        case 0:
            return bytes([PUBACK, 2]) + struct.pack(">H", random.randrange(1, 200))
        case 1:
            return bytes([random.randrange(256), random.randrange(128)]) + random.randbytes(random.randrange(60))
        case 2:
            topic = random.randbytes(random.randrange(10))
            body = struct.pack(">H", len(topic)) + topic + random.randbytes(5)
            return bytes([0x30, len(body)]) + body
        case 3:
            return b"\x20\x02\x00" + bytes([random.randrange(256)])
        case 4:
            return b"\x30\xff\xff\xff" + bytes([random.choice((0x7F, 0xFF))])
        case _:
            return random.randbytes(random.randrange(100))


SERVERS = (Target("control socket", control_socket, (), 1.0), Target("hostile broker", hostile_broker, (), 3.0))
