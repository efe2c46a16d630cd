"""The measurements of `speed` that have another program as their peer: python-can with canopen, and mosquitto."""

from __future__ import annotations

import asyncio
import os
import statistics
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self
from unittest.mock import patch

import aiomqtt
from broker import Mosquitto
from can_pair import pair

from regolithd.daemon.publish.spool import Spool
from regolithd.drivers import benchmark
from regolithd.drivers.can import socketcan
from regolithd.drivers.can.recvmmsg import CAN_FRAME

if TYPE_CHECKING:
    import socket
    from collections.abc import Iterator

ROUNDS = 9
MESSAGES = 400
PAYLOAD = b"x" * 2000
"""As large as a snapshot message."""
PERSISTENT = "persistence true\npersistence_location {folder}/\nmax_queued_messages 0\nallow_anonymous true\n"
EVERY_CHANGE = "autosave_on_changes true\nautosave_interval 1\n"
Figures = dict[str, float | int | str | bool | None]


def frames_on_bus() -> list[bytes]:
    """Return frames as other devices on the bus may send them: TPDO 1 to 4 of nodes that nobody expects."""
    cob_ids = [base + node for node in range(40, 104) for base in (0x180, 0x280, 0x380, 0x480)]
    return [CAN_FRAME.pack(cob_id, 8, bytes(range(8))) for cob_id in cob_ids]


class Sender:
    """Takes the place of the sending CAN socket in the benchmark of the readers: the other end of the pair."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end

    def __call__(self, *_: object) -> Sender:
        """Return itself, as `socket.socket(…)` does a socket."""
        return self

    def __enter__(self) -> Self:
        """Begin to use it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the pair open."""

    def bind(self, address: object) -> None:
        """Do nothing: a pair has no address."""

    def send(self, frame: bytes) -> int:
        """Send a frame."""
        return self._end.send(frame)


@contextmanager
def on_pair() -> Iterator[None]:
    """Let both readers of the benchmark, and its sender, use a pair of sockets in place of SocketCAN."""
    reader, sender = pair()
    try:
        with (
            patch.object(socketcan, "_open_socket", lambda _: reader),
            patch("can.interfaces.socketcan.socketcan.create_socket", lambda: reader),
            patch("can.interfaces.socketcan.socketcan.bind_socket", lambda *_: None),
            patch("can.interfaces.socketcan.socketcan.log"),
            patch.object(benchmark.socket, "socket", Sender(sender)),
        ):
            yield
    finally:
        reader.close()
        sender.close()


async def frame_times() -> Figures:
    """Return the time for a frame, ours and theirs: decoded alone, in bursts, one at a time."""
    rounds: dict[str, list[tuple[float, float]]] = {"decode": [], "burst": [], "one at a time": []}
    for _ in range(ROUNDS):
        rounds["decode"].append(benchmark.decoding_time())
        both = []
        for way in (benchmark.ours, benchmark.theirs):
            with on_pair():
                both.append(await benchmark.reading_time(way, "pair"))
        rounds["burst"].append((both[0][0], both[1][0]))
        rounds["one at a time"].append((both[0][1], both[1][1]))
    found: Figures = {}
    for name, pairs in rounds.items():
        mine, theirs = (statistics.median(each[k] for each in pairs) for k in (0, 1))
        found |= {
            f"a frame, {name} / regolithd, µs": mine,
            f"a frame, {name} / python-can and canopen, µs": theirs,
            f"a frame, {name} / times": theirs / mine,
        }
    return found


def store_cost() -> Figures:
    """Return the processor time for storing a message in our store, and how many a killed process has lost."""
    with tempfile.TemporaryDirectory() as name:
        child = os.fork()
        if child == 0:
            spool = Spool(Path(name), 100_000_000)
            began = time.process_time()
            for _ in range(MESSAGES):
                spool.append("snapshot", PAYLOAD)
            Path(name, "cpu").write_text(str((time.process_time() - began) / MESSAGES * 1e6))
            os.kill(os.getpid(), 9)
        os.waitpid(child, 0)
        kept = Spool(Path(name), 100_000_000).queued
        return {
            "a stored message, 2 kB / regolithd's store: CPU, µs": float(Path(name, "cpu").read_text()),
            "a stored message, 2 kB / lost by SIGKILL, of 400": MESSAGES - kept,
        }


async def mosquitto_persistence() -> Figures:
    """Return the same of mosquitto, which stores for a client that is away: saved each minute, and at each change."""
    found: Figures = {}
    for name, settings in (("saved every 30 min (default)", ""), ("saved at each change", EVERY_CHANGE)):
        cpu_us, lost = await _mosquitto_store(settings)
        found |= {
            f"the same by mosquitto, {name} / regolithd's store: CPU, µs": None,
            f"the same by mosquitto, {name} / lost by SIGKILL, of 400": lost,
            f"the same by mosquitto, {name} / mosquitto: CPU, µs": cpu_us,
        }
    return found


async def _mosquitto_store(settings: str) -> tuple[float, int]:
    with tempfile.TemporaryDirectory() as name:
        broker = Mosquitto(Path(name), settings=PERSISTENT.format(folder=name) + settings)
        broker.start()
        away = {"identifier": "away", "clean_session": False}
        async with aiomqtt.Client("127.0.0.1", broker.port, **away) as taker:
            await taker.subscribe("a", qos=1)
        assert broker.process is not None
        before = _cpu_s(broker.process.pid)
        async with aiomqtt.Client("127.0.0.1", broker.port) as sender:
            for _ in range(MESSAGES):
                await sender.publish("a", PAYLOAD, qos=1)
        cpu_us = (_cpu_s(broker.process.pid) - before) / MESSAGES * 1e6
        broker.kill()
        broker.start()
        kept = 0
        async with aiomqtt.Client("127.0.0.1", broker.port, **away) as taker:
            with suppress(TimeoutError):
                while True:
                    async with asyncio.timeout(2):
                        await anext(taker.messages)
                        kept += 1
        broker.stop()
        return cpu_us, MESSAGES - kept


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
