"""Our store of undelivered messages beside mosquitto's: a subscriber is away while messages of 2 kB are stored.

| | ours | mosquitto's |
|---|---|---|
| who stores | the daemon, while the broker is away | the broker, while a client with a session is away |
| stored | when it is written to the kernel | when the broker has acknowledged it |
| then | SIGKILL of the process that stored it | SIGKILL of the broker, and its start |
| delivered | to a subscriber, by the publisher, which sends at most `MAX_LATE_PER_S` | to the client that was away |
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import aiomqtt
from broker import Mosquitto, mosquitto_program
from process_cpu import cpu_s

from regolithd.daemon.config.configuration import Configuration, Mqtt
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.spool import Spool
from regolithd.daemon.publish.stores import Stores

MESSAGES, AT_ONCE = 400, 40
"""Messages, and how many of them are sent to mosquitto before the first is acknowledged."""
PAYLOAD = b'{"schema_version":2,"late":false,"text":"' + b"x" * 2000 + b'"}'
"""As large as a snapshot message."""
LIMIT_BYTES = 100_000_000
SILENCE_S = 2.0
"""A subscriber that has received nothing for this long gets no more."""
PERSISTENT = (
    "persistence true\npersistence_location {folder}/\nmax_queued_messages 0\nallow_anonymous true\n"
    "set_tcp_nodelay true\n"
)
EVERY_CHANGE = "autosave_on_changes true\nautosave_interval 1\n"
REMEDY = "mosquitto is not here: apt-get install mosquitto"


@dataclass(frozen=True)
class Stored:
    """What storing and delivering has cost; None where nothing was delivered."""

    cpu_us: float
    stored_per_s: float
    delivered_per_s: float | None
    lost: int


def available() -> bool:
    """Return whether there is a mosquitto."""
    return mosquitto_program() is not None


def store_and_kill(folder: Path) -> tuple[float, float]:
    """Store all messages in a process that then kills itself; return CPU [µs] and rate [1/s].

    It is no fork: a test before may have loaded JAX and its threads.
    """
    script = "import sys; from pathlib import Path; from speed_queue import store; store(Path(sys.argv[1]))"
    ended = subprocess.run([sys.executable, "-c", script, folder], cwd=Path(__file__).parent, check=False)
    if ended.returncode != -signal.SIGKILL:
        raise RuntimeError(f"the process that stores ended with {ended.returncode}")
    cpu_us, per_s = map(float, (folder / "cost").read_text().split())
    return cpu_us, per_s


def store(folder: Path) -> None:
    """Store all messages, write what each cost, and kill this process."""
    spool = Stores.open(folder / "spool", LIMIT_BYTES).snapshots
    began, used = time.perf_counter(), time.process_time()
    for _ in range(MESSAGES):
        spool.append("snapshot", PAYLOAD)
    cpu_us = (time.process_time() - used) / MESSAGES * 1e6
    (folder / "cost").write_text(f"{cpu_us} {MESSAGES / (time.perf_counter() - began)}")
    os.kill(os.getpid(), signal.SIGKILL)


def store_cost() -> Stored:
    """Return the cost of storing in our store, and what a killed process has lost; nothing is delivered."""
    with tempfile.TemporaryDirectory() as name:
        cpu_us, per_s = store_and_kill(Path(name))
        kept = Spool(Path(name) / "spool", LIMIT_BYTES).queued
    return Stored(cpu_us, per_s, None, MESSAGES - kept)


async def ours() -> Stored:
    """Store, kill, and deliver by the publisher to a subscriber of a broker."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cpu_us, per_s = store_and_kill(folder)
        broker = Mosquitto(folder, settings="allow_anonymous true\nset_tcp_nodelay true\n")
        broker.start()
        mqtt = Mqtt(host=broker.host, port=broker.port, spool_directory=folder / "spool")
        configuration = Configuration(mqtt=mqtt)
        stores = Stores.open(mqtt.spool_directory, LIMIT_BYTES)
        async with aiomqtt.Client(broker.host, broker.port) as subscriber:
            await subscriber.subscribe(f"{mqtt.prefix}/{configuration.rover.name}/snapshot", qos=1)
            publishing = asyncio.create_task(Publisher(configuration, stores).run())
            times = await arrivals(subscriber)
        publishing.cancel()
        with suppress(asyncio.CancelledError):
            await publishing
        stores.close()
        broker.stop()
    return Stored(cpu_us, per_s, rate(times), MESSAGES - len(times))


async def mosquittos(settings: str) -> Stored:
    """Let mosquitto store for a client that is away, kill it, start it, and let the client return."""
    with tempfile.TemporaryDirectory() as name:
        broker = Mosquitto(Path(name), settings=PERSISTENT.format(folder=name) + settings)
        broker.start()
        away = {"identifier": "away", "clean_session": False}
        async with aiomqtt.Client(broker.host, broker.port, **away) as client:
            await client.subscribe("a", qos=1)
        assert broker.process is not None
        began, used_s = time.perf_counter(), cpu_s(broker.process.pid)
        async with aiomqtt.Client(broker.host, broker.port, max_inflight_messages=AT_ONCE) as sender:
            sender.pending_calls_threshold = AT_ONCE
            for _ in range(MESSAGES // AT_ONCE):
                await asyncio.gather(*(sender.publish("a", PAYLOAD, qos=1) for _ in range(AT_ONCE)))
        per_s = MESSAGES / (time.perf_counter() - began)
        cpu_us = (cpu_s(broker.process.pid) - used_s) / MESSAGES * 1e6
        broker.kill()
        broker.start()
        async with aiomqtt.Client(broker.host, broker.port, **away) as client:
            times = await arrivals(client)
        broker.stop()
    return Stored(cpu_us, per_s, rate(times), MESSAGES - len(times))


async def arrivals(client: aiomqtt.Client) -> list[float]:
    """Return when each message arrived, until none has come for `SILENCE_S`."""
    times: list[float] = []
    with suppress(TimeoutError):
        while True:
            async with asyncio.timeout(SILENCE_S):
                await anext(client.messages)
            times.append(time.perf_counter())
    return times


def rate(times: list[float]) -> float | None:
    """Return messages per second; None for fewer than two."""
    return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else None
