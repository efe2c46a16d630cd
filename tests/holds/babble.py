"""A node that sends EMCY without a pause, or drives whose statusword flips at each of 200 SYNCs a second.

The daemon runs with recording, control socket and a real broker, on a bus in this process that carries the PDOs of all
nodes. Another process subscribes, and notes when each snapshot arrives.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from broker import Mosquitto

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.pdo_frames import frames
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.daemon.wiring import connect_sinks, open_stores
from regolithd.drivers.can.bus import Bus
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.emcy import emergency_frame

if TYPE_CHECKING:
    from contextlib import AsyncExitStack
    from pathlib import Path

BUS_SPEED = 9009
"""Frames of 8 bytes a second on a bus of 1 Mbit/s."""
SLICE_S = 0.005
IN_TIME_S = 1.0
"""A snapshot that arrives within this time, and is not marked late, is in time."""
STATUSWORDS = (0x1237, 0x1233)  # operation enabled, switched on
SUBSCRIBER = """
import sys, time, paho.mqtt.client as mqtt
out = open(sys.argv[2], "w", buffering=1)
client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
client.on_connect = lambda c, *_: c.subscribe([("regolith/+/snapshot", 1), ("regolith/+/alarm/#", 1),
                                               ("regolith/+/emcy", 1), ("regolith/+/event", 1)])
client.on_subscribe = lambda *_: print("ready", flush=True)
client.on_message = lambda c, u, m: out.write(f"{time.time_ns()} {m.topic} {m.payload.decode()}\\n")
client.connect("127.0.0.1", int(sys.argv[1]))
client.loop_forever()
"""


@dataclass(frozen=True)
class Babble:
    """What came of one run."""

    syncs: int
    in_time: int
    disturbances: int
    alarms: int
    events: int
    cpu_share: float
    stopped_after_s: float


class LoadedBus(Bus):
    """A bus on which all nodes answer each SYNC, and one babbles: `emcy_Hz` EMCY messages a second."""

    def __init__(self, emcy_Hz: float, *, flips: bool) -> None:
        super().__init__("load", "load0")
        world, nodes = VirtualWorld(), Configuration().described()
        speed = np.full(6, 100.0)
        self._answers = [
            [(frame.can_id, frame.data) for frame in frames(nodes, 0, speed, world.measure(k / 10, speed))][1:]
            for k in range(20)
        ]
        if flips:
            self._answers = [_flipped(answers, k) for k, answers in enumerate(self._answers)]
        self._turn = cycle(self._answers)
        self._per_slice = emcy_Hz * SLICE_S
        self.disturbances = self.syncs = 0
        self._dropping = False
        self.flips = flips
        self.sync_ns: list[int] = []

    async def send(self, frame: Frame) -> None:
        """Take a frame of the daemon; answer a SYNC."""
        now = time.time_ns()
        echo = Frame(now, frame.can_id, frame.data, sent=True)
        if frame.can_id != cob_id.SYNC:
            self.deliver([echo])
            return
        self.syncs += 1
        self.sync_ns.append(now // 1000)
        self.disturbances += 6 * self.flips
        self.deliver([echo, *(Frame(now + 1_000_000, can_id, data) for can_id, data in next(self._turn))])

    async def babble(self) -> None:
        """Send EMCY messages until cancelled."""
        due, number = time.monotonic(), 0.0
        while self._per_slice:
            number += self._per_slice
            count, number = int(number), number % 1
            now = time.time_ns()
            if self._dropping:
                self.counters.kernel_drops += count
            else:
                self.deliver([emergency_frame(13, 0x5000, 1)._replace(time_ns=now)] * count)
            self.disturbances += count
            due = max(due + SLICE_S, time.monotonic() - SLICE_S)  # a bus does not catch up
            await asyncio.sleep(max(0.0, due - time.monotonic()))

    def pause_reading(self) -> None:
        """Drop frames, as a kernel does."""
        self._dropping = True

    def resume_reading(self) -> None:
        """Drop no more frames."""
        self._dropping = False

    def close(self) -> None:
        """Do nothing."""


def _flipped(answers: list[tuple[int, bytes]], k: int) -> list[tuple[int, bytes]]:
    """Return the answers with another statusword in every second SYNC."""
    old, new = (word.to_bytes(2, "little") for word in (STATUSWORDS[0], STATUSWORDS[k % 2]))
    return [(can_id, data.replace(old, new) if can_id & 0x7F <= 6 else data) for can_id, data in answers]


class LoadedService(Service):
    """The service on a bus that is given."""

    def __init__(self, configuration: Configuration, bus: LoadedBus) -> None:
        super().__init__(configuration, load_models(configuration))
        self.loaded_bus = bus

    async def _open_bus(self, opened: AsyncExitStack) -> Bus:
        del opened
        return self.loaded_bus


def run_babble(folder: Path, seconds: float, rate_Hz: float, emcy_Hz: float, *, flips: bool = False) -> Babble:
    """Run the daemon for so long, stop it while the babbling goes on, and count."""
    broker = Mosquitto(folder)
    broker.settings += "max_queued_messages 10000\nset_tcp_nodelay true\n"
    broker.start()
    received = folder / "received"
    command = [sys.executable, "-c", SUBSCRIBER, str(broker.port), str(received)]
    listener = subprocess.Popen(command, stdout=subprocess.PIPE)
    try:
        assert listener.stdout is not None
        listener.stdout.readline()
        bus = LoadedBus(emcy_Hz, flips=flips)
        syncs, cpu_share, stopped_after_s = asyncio.run(_run(configuration(folder, rate_Hz, broker.port), bus, seconds))
    finally:
        listener.terminate()
        listener.communicate()
        broker.stop()
    in_time, alarms, events = counted(received.read_text(), bus.sync_ns[syncs])
    return Babble(syncs.stop - syncs.start, in_time, bus.disturbances, alarms, events, cpu_share, stopped_after_s)


def configuration(folder: Path, rate_Hz: float, port: int) -> Configuration:
    """Return the daemon's configuration."""
    return Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": "load0"},
            "sync": {"rate_Hz": rate_Hz},
            "recording": {"directory": folder / "recordings"},
            "mqtt": {"host": "127.0.0.1", "port": port, "spool_directory": folder / "spool"},
            "control": {"socket": folder / "control.sock", "group": str(os.getgid())},
        }
    )


async def _run(configuration: Configuration, bus: LoadedBus, seconds: float) -> tuple[slice, float, float]:
    """Return the SYNCs that count, the share of a core that was used, and the time that the end took [s]."""
    service = LoadedService(configuration, bus)
    connect_sinks(service, open_stores(service.configuration.mqtt))
    babbling = asyncio.create_task(bus.babble())
    running = asyncio.create_task(service.run())
    await asyncio.sleep(2.0)  # connected, and the buckets of the throttle are empty
    first, cpu, begun = bus.syncs, time.process_time(), time.monotonic()
    await asyncio.sleep(seconds)
    last, cpu, elapsed = bus.syncs, time.process_time() - cpu, time.monotonic() - begun
    await asyncio.sleep(IN_TIME_S)
    stopping = time.monotonic()
    running.cancel()
    with suppress(asyncio.CancelledError):
        await running
    stopped_after_s = time.monotonic() - stopping
    babbling.cancel()
    await asyncio.sleep(0.5)  # the broker delivers
    return slice(first, last), cpu / elapsed, stopped_after_s


def counted(received: str, syncs_us: list[int]) -> tuple[int, int, int]:
    """Return how many SYNCs have a snapshot in time; the event-rate alarms that began; EMCY and events."""
    wanted, in_time, alarms, events = set(syncs_us), set(), 0, 0
    for line in received.splitlines():
        arrived, topic, payload = line.split(" ", 2)
        kind = topic.split("/", 2)[2]
        message = json.loads(payload)
        if kind == "snapshot":
            sync_us = _microseconds(message["time"])
            if sync_us in wanted and not message["late"] and int(arrived) / 1000 - sync_us < IN_TIME_S * 1e6:
                in_time.add(sync_us)
        elif kind == "alarm/event-rate":
            alarms += message["active"]
        elif kind in {"emcy", "event"}:
            events += 1
    return len(in_time), alarms, events


def _microseconds(text: str) -> int:
    whole, _, fraction = text.rstrip("Z").partition(".")
    return int(np.datetime64(whole, "s").astype(np.int64)) * 1_000_000 + int(fraction.ljust(6, "0")[:6] or 0)
