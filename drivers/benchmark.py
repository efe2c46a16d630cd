"""Benchmark: CPU time per received frame, ours against python-can's asyncio Notifier with canopen's `.raw`, in one run.

    make frames                                  on vcan, in User Mode Linux where this kernel has none
    python -m regolithd.drivers.benchmark [vcan0]          without such a link: the decoders alone

Both get the same motor TPDOs and end at the same three SI values, which is checked.

    decode    from the frame to the values; no bus
    burst     200 frames wait in the socket, as after a SYNC on a busy bus: read and decode them all
    single    one frame at a time, each alone on a quiet bus (`PAUSE_S`), wake-up included

Both run in the same process, in turns; the best of the rounds counts, as other load on the machine adds time. In
User Mode Linux a system call (locks among them) takes some 200 times as long as natively, which raises the ratios.
"""

from __future__ import annotations

import asyncio
import json
import math
import socket
import struct
import sys
import time
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import can
import canopen

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.moderated_reader import INTERVAL_S
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.can.recvmmsg import CAN_FRAME
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.pdo import tpdos
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import BusOpenError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable
    from contextlib import AbstractAsyncContextManager

NODE_ID, COB_ID = 1, 0x181
FRAMES, ROUNDS = 200, 15
PAUSE_S = 2 * INTERVAL_S
FIGURES = Path("build/figures/reader_benchmark.json")
DATA = [struct.pack("<Hhi", 0x0637, number, -number) for number in range(FRAMES)]
Values = tuple[float, float, float]
LAST: Values = (0x0637, (FRAMES - 1) * 1e-3, -(FRAMES - 1) * 2.0 * math.pi / 60.0)


class DecodedValues:
    """Counts the decoded frames and keeps the last values."""

    def __init__(self) -> None:
        self.count = 0
        self.last: Values = (0.0, 0.0, 0.0)
        self._wanted = 0
        self._reached = asyncio.Event()

    def take(self, values: Values) -> None:
        """Count a frame's values."""
        self.count += 1
        self.last = values
        if self.count == self._wanted:
            self._reached.set()

    async def more(self, frames: int) -> None:
        """Wait until so many more have come."""
        self._wanted = self.count + frames
        self._reached.clear()
        await self._reached.wait()


def our_decoder() -> Callable[[Frame], Values]:
    """Return our decoder as a function from a frame to its values."""
    decode = Decoder([NodeDescription(NODE_ID, MOTOR_CONTROLLER, 0)]).decode

    def values(frame: Frame) -> Values:
        signal = decode(frame)
        if not isinstance(signal, Reading):
            raise TypeError(f"{frame} is no reading")
        (_, status), (_, current), (_, speed) = signal.values
        return status, current, speed

    return values


def their_network(take: Callable[[Values], None]) -> canopen.Network:
    """Return a canopen network that hands the values of each TPDO 1 to `take`."""
    network = canopen.Network()
    pdo = network.add_node(NODE_ID, str(MOTOR_CONTROLLER.eds)).tpdo[1]
    pdo.clear()
    status, current, speed = (pdo.add_variable(index) for index in (0x6041, 0x6078, 0x606C))
    pdo.cob_id, pdo.enabled = tpdos(MOTOR_CONTROLLER)[0].cob_id(NODE_ID), True
    pdo.subscribe()
    rpm = 2.0 * math.pi / 60.0
    pdo.add_callback(lambda _pdo: take((float(status.raw), current.raw * 1e-3, speed.raw * rpm)))
    return network


@asynccontextmanager
async def ours(channel: str) -> AsyncIterator[DecodedValues]:
    """Read with `drivers.can.socketcan`, decode with `drivers.devices.decoding.decoder`."""
    decoded, values = DecodedValues(), our_decoder()

    async def read() -> None:
        async for batch in bus:
            for frame in batch:
                decoded.take(values(frame))

    async with open_bus("socketcan", channel) as bus, asyncio.TaskGroup() as tasks:
        reading = tasks.create_task(read())
        yield decoded
        reading.cancel()


@asynccontextmanager
async def theirs(channel: str) -> AsyncIterator[DecodedValues]:
    """Read with python-can's asyncio Notifier, decode with canopen's variables."""
    decoded = DecodedValues()
    network = their_network(decoded.take)
    with can.Bus(channel, interface="socketcan", receive_own_messages=True) as bus:
        notifier = can.Notifier(bus, network.listeners, loop=asyncio.get_running_loop())
        yield decoded
        notifier.stop(timeout=0.1)


async def reading_time(
    way: Callable[[str], AbstractAsyncContextManager[DecodedValues]], channel: str
) -> tuple[float, float]:
    """Return the time per frame in a burst and singly [µs]."""
    frames = [CAN_FRAME.pack(COB_ID, 8, data) for data in DATA]
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
        sender.bind((channel,))
        async with way(channel) as decoded:
            for frame in frames:
                sender.send(frame)
            start = time.process_time()
            await decoded.more(FRAMES)
            burst_s = time.process_time() - start
            singly_s = 0.0
            for frame in frames:
                time.sleep(PAUSE_S)  # noqa: ASYNC251  # nothing else is to run
                sender.send(frame)
                start = time.process_time()
                await decoded.more(1)
                singly_s += time.process_time() - start
            check(decoded.last)
    return burst_s / FRAMES * 1e6, singly_s / FRAMES * 1e6


def decoding_time() -> tuple[float, float]:
    """Return the time that our decoder and canopen's take per frame [µs]."""
    mine, peers = our_decoder(), DecodedValues()
    network = their_network(peers.take)
    start = time.process_time()
    for data in DATA:
        last = mine(Frame(0, COB_ID, data))
    between = time.process_time()
    for data in DATA:
        network.notify(COB_ID, bytearray(data), 0.0)
    end = time.process_time()
    check(last)
    check(peers.last)
    return (between - start) / FRAMES * 1e6, (end - between) / FRAMES * 1e6


def check(last: Values) -> None:
    """Raise where one of the two decoded wrong values."""
    if not all(math.isclose(one, two) for one, two in zip(last, LAST, strict=True)):
        raise AssertionError(f"decoded {last}, sent was {LAST}")


async def compare(channel: str | None) -> dict[str, list[tuple[float, float]]]:
    """Return (ours, theirs) of each round [µs], taken in turns."""
    rounds: dict[str, list[tuple[float, float]]] = {"decode": [], "burst": [], "single": []}
    for _ in range(ROUNDS):
        rounds["decode"].append(decoding_time())
        if channel is not None:
            mine, peers = await reading_time(ours, channel), await reading_time(theirs, channel)
            rounds["burst"].append((mine[0], peers[0]))
            rounds["single"].append((mine[1], peers[1]))
    return {name: pairs for name, pairs in rounds.items() if pairs}


async def reachable(channel: str) -> str | None:
    """Return the channel; None, with a message, where it cannot be opened."""
    try:
        async with open_bus("socketcan", channel):
            return channel
    except BusOpenError as error:
        sys.stderr.write(f"{error}\nThe decoders alone:\n")
        return None


def main() -> None:
    """Print the comparison, and write it to `build/figures`."""
    channel = asyncio.run(reachable(sys.argv[1] if len(sys.argv) > 1 else "vcan0"))
    figures: dict[str, float] = {}
    lines = [f"{'µs per frame':<14}{'ours':>10}{'python-can, canopen':>22}{'times':>8}"]
    for name, pairs in asyncio.run(compare(channel)).items():
        mine, peers = min(one for one, _ in pairs), min(two for _, two in pairs)
        ratio = peers / mine
        figures |= {f"{name}_ours_us": mine, f"{name}_theirs_us": peers, f"{name}_ratio": ratio}
        lines.append(f"{name:<14}{mine:>10.2f}{peers:>22.2f}{ratio:>8.1f}")
    sys.stdout.write("\n".join(lines) + "\n")
    FIGURES.parent.mkdir(parents=True, exist_ok=True)
    FIGURES.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
