"""Measures what the daemon costs, beside other programs in the same run: `make bench`. Writes build/figures/bench.json.

Processor time is read from the kernel for the process alone, and given for one SYNC or frame as well, so that other
load on the machine changes it little; latencies are of the machine as it is (`load average` is written beside them).
The daemon runs as a process of its own, on a pair of sockets in place of SocketCAN (`can_pair`), with the virtual rover
in another process, and mosquitto with `systemd/mosquitto`'s TCP_NODELAY.
"""

from __future__ import annotations

import argparse
import asyncio
import grp
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
import timeit
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import aiomqtt
from broker import Mosquitto
from can_pair import pair
from process_cpu import cpu_s
from speed_candump import FASTEST_BUS
from speed_peers import candump, frame_times, frames_on_bus, queues
from speed_table import Figures, Row, flat

if TYPE_CHECKING:
    import socket
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "build/figures/bench.json"
ROVER = """
[sync]
rate_Hz = {rate}
[nodes]
inclinometer = 21
ground_speed = 22
[drivetrain]
no_load_current_A = 0.037
no_load_current_std_A = 0.001
[recording]
directory = "recordings"
[control]
socket = "control.sock"
group = "{group}"
[mqtt]
host = "127.0.0.1"
port = {port}
spool_directory = "spool"
"""
LIBRARIES = "python-can, canopen, paho"
IMPORTS = {
    # As `regolithd run` does it: without looking for garbage once the command line is there.
    "regolithd": "import regolithd.daemon.cli, gc; gc.disable(); "
    "import regolithd.daemon.setup, regolithd.daemon.service, "
    "regolithd.daemon.wiring, regolithd.drivers.can.socketcan",
    LIBRARIES: "import asyncio, can, canopen, paho.mqtt.client",
    "numpy": "import numpy",
    "numpy and onnxruntime": "import os; os.environ['ORT_DISABLE_TELEMETRY'] = '1'; import numpy, onnxruntime",
    "asyncio": "import asyncio",
}
PARTS = ("asyncio", "numpy", "numpy and onnxruntime")


@dataclass
class Rig:
    """A running daemon: its process, the broker, the other end of its CAN link, and snapshots as they arrive."""

    process: subprocess.Popen[bytes]
    port: int
    link: socket.socket
    delays_ms: list[float] = field(default_factory=list)
    produced: list[int] = field(default_factory=list)
    skipped: list[int] = field(default_factory=list)

    def cpu_s(self) -> float:
        """Return the processor time that the daemon has used."""
        return cpu_s(self.process.pid)

    def memory_MB(self) -> float:
        """Return its resident memory."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1e3

    async def subscribe(self) -> None:
        """Note the delay of each snapshot, SYNC to subscriber, and the counters of SYNC, until cancelled."""
        options = (aiomqtt.client.socket.IPPROTO_TCP, aiomqtt.client.socket.TCP_NODELAY, 1)  # type: ignore[attr-defined]
        async with aiomqtt.Client("127.0.0.1", self.port, socket_options=[options]) as client:
            await client.subscribe([("regolith/kapvik/snapshot", 1), ("regolith/kapvik/health", 0)])
            async for message in client.messages:
                now_ms = time.time_ns() / 1e6
                content = json.loads(bytes(message.payload))
                if str(message.topic).endswith("snapshot"):
                    if not content["late"]:
                        self.delays_ms.append(now_ms - content["time_ms"])
                elif content["sync"]:
                    self.produced.append(content["sync"]["produced"])
                    self.skipped.append(content["sync"]["skipped"] + content["sync"]["failed"])


@contextmanager
def rig(rate: float) -> Iterator[Rig]:
    """Start broker, rover and daemon; stop all three at the end."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        broker = Mosquitto(folder, settings="allow_anonymous true\nset_tcp_nodelay true\n")
        broker.start()
        group = grp.getgrgid(os.getgid()).gr_name
        (folder / "rover.toml").write_text(ROVER.format(rate=rate, group=group, port=broker.port))
        daemons, rovers = pair()
        environment = os.environ | {"OMP_NUM_THREADS": "1", "PYDANTIC_DISABLE_PLUGINS": "__all__"}
        program = [sys.executable, str(ROOT / "tests/bench/can_pair.py")]
        ends = {"rover": (rovers, []), "daemon": (daemons, [str(folder / "rover.toml")])}
        started = [
            subprocess.Popen(
                [*program, role, str(end.fileno()), *more], pass_fds=[end.fileno()], env=environment, cwd=ROOT
            )
            for role, (end, more) in ends.items()
        ]
        try:
            yield Rig(started[1], broker.port, rovers)
        finally:
            for process in reversed(started):
                process.terminate()
                process.wait(20)
            broker.stop()
            daemons.close()
            rovers.close()


@dataclass(frozen=True)
class Cost:
    """What the daemon has used in `elapsed_s`."""

    elapsed_s: float
    cpu_s: float
    syncs: int
    skipped: int
    memory_MB: float
    frames_sent: int

    @property
    def core_percent(self) -> float:
        """Share of one core."""
        return 100 * self.cpu_s / self.elapsed_s

    @property
    def cpu_ms_per_sync(self) -> float:
        """Processor time for each SYNC."""
        return 1e3 * self.cpu_s / max(self.syncs, 1)


async def measure(rate: float, seconds: float, frames_per_s: int = 0) -> tuple[Cost, Rig]:
    """Run a daemon at a SYNC rate; return CPU, memory and delays over `seconds`, after the nodes have booted."""
    with rig(rate) as running:
        receiving = asyncio.create_task(running.subscribe())
        while len(running.delays_ms) < 3 or len(running.produced) < 10:  # noqa: ASYNC110  # a list has no event
            await asyncio.sleep(0.2)
        running.delays_ms.clear()
        syncs, skipped = running.produced[-1], running.skipped[-1]
        before_s, began = running.cpu_s(), time.monotonic()
        sent = await send_frames(running.link, frames_per_s, seconds)
        elapsed_s = time.monotonic() - began
        used_s = running.cpu_s() - before_s
        memory_MB = running.memory_MB()
        await end(receiving)
    done, left_out = running.produced[-1] - syncs, running.skipped[-1] - skipped
    return Cost(elapsed_s, used_s, done, left_out, memory_MB, sent), running


async def end(task: asyncio.Task[None]) -> None:
    """Cancel a task and wait for its end."""
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


async def send_frames(link: socket.socket, per_s: int, seconds: float) -> int:
    """Send frames of nodes that nobody expects for `seconds`, evenly in time; return how many were sent."""
    if not per_s:
        await asyncio.sleep(seconds)
        return 0
    began, sent, frames = time.monotonic(), 0, frames_on_bus()
    while (elapsed_s := time.monotonic() - began) < seconds:
        while sent < elapsed_s * per_s:
            try:
                link.send(frames[sent % len(frames)])
            except BlockingIOError:
                break
            sent += 1
        await asyncio.sleep(0.002)
    return sent


async def broker_delay(messages: int) -> list[float]:
    """Return the delays of mosquitto alone, QoS 1, 2 kB, 100 a second, client to client [ms]."""
    delays: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        broker = Mosquitto(Path(name), settings="allow_anonymous true\nset_tcp_nodelay true\n")
        broker.start()
        async with (
            aiomqtt.Client("127.0.0.1", broker.port) as sender,
            aiomqtt.Client("127.0.0.1", broker.port) as taker,
        ):
            await taker.subscribe("a", qos=1)

            async def take() -> None:
                while True:
                    message = await anext(taker.messages)
                    delays.append(1e3 * (time.monotonic() - float(bytes(message.payload)[:20])))

            receiving = asyncio.create_task(take())
            for _ in range(messages):
                await sender.publish("a", f"{time.monotonic():020.9f}".ljust(2000), qos=1)
                await asyncio.sleep(0.01)
            await end(receiving)
        broker.stop()
    return delays


def import_cost(statement: str) -> tuple[float, float]:
    """Return processor time [s] and memory [MB] of importing, with those of the interpreter; the least of five.

    The modules are compiled before, as those of an installation are.
    """
    code = f"{statement}\nimport time\nprint(time.process_time(), *open('/proc/self/statm'))"
    with tempfile.TemporaryDirectory() as compiled:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | {
            "PYTHONPATH": str(ROOT / "src"),
            "PYTHONPYCACHEPREFIX": compiled,
            "PYDANTIC_DISABLE_PLUGINS": "__all__",
        }
        command = [sys.executable, "-c", code]
        runs = [subprocess.run(command, check=True, capture_output=True, text=True, env=environment) for _ in range(6)]
    found = [run.stdout.split() for run in runs[1:]]
    pages = min(int(each[2]) for each in found)  # size, then resident
    return min(float(each[0]) for each in found), pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def import_rows() -> list[Row]:
    """Return what importing costs, and what of it the largest packages do."""
    costs = {name: import_cost(statement) for name, statement in IMPORTS.items()}
    (ours_s, ours_MB), (theirs_s, theirs_MB) = costs["regolithd"], costs[LIBRARIES]
    return [
        Row("import, s CPU", ours_s, "at most 0.4", theirs_s, LIBRARIES),
        Row("import: memory, MB", ours_MB, "", theirs_MB, LIBRARIES),
        *(Row(f"import of {name} alone, s CPU", costs[name][0]) for name in PARTS),
        *(Row(f"import of {name} alone: memory, MB", costs[name][1]) for name in PARTS),
    ]


def percentile(values: list[float], share: float) -> float | None:
    """Return a percentile; None without values."""
    return statistics.quantiles(values, n=1000)[round(share * 1000) - 1] if len(values) > 1 else None


async def daemon_rows(seconds: float) -> list[Row]:
    """Return CPU, memory and delays of the daemon at 100 Hz, at 2 Hz and on a saturated bus."""
    fast, running = await measure(100.0, seconds)
    alone = await broker_delay(round(seconds * 50))
    slow, _ = await measure(2.0, seconds)
    quiet, _ = await measure(2.0, seconds)
    full, _ = await measure(2.0, seconds, FASTEST_BUS)
    frame_us = 1e6 * (full.cpu_s - quiet.cpu_s) / max(full.frames_sent, 1)
    sent_per_s = full.frames_sent / full.elapsed_s
    return [
        *delay_rows(running.delays_ms, alone),
        # As if no SYNC had been skipped: on a busy machine some are.
        Row("100 Hz with recording and publishing, % of a core", fast.cpu_ms_per_sync * 10, "at most 12"),
        Row("100 Hz: SYNCs skipped", fast.skipped, "0"),
        Row("100 Hz: memory, MB", fast.memory_MB),
        Row("2 Hz, % of a core", slow.core_percent, "at most 0.5"),
        Row("2 Hz: memory, MB", slow.memory_MB, "at most 90"),
        Row("saturated bus: frames sent per s", sent_per_s, str(FASTEST_BUS)),
        Row("saturated bus: CPU per frame, µs", frame_us),
        Row("saturated bus, % of a core at 9009 frames/s", frame_us * FASTEST_BUS / 1e4, "at most 8"),
        Row("saturated bus: SYNCs skipped", full.skipped, "0"),
    ]


def delay_rows(delays_ms: list[float], alone_ms: list[float]) -> list[Row]:
    """Return the delays from SYNC to subscriber, beside those of the broker alone."""
    peer = "mosquitto alone, client to client"
    name = "SYNC to subscriber at 100 Hz"
    p99, alone_p99 = percentile(delays_ms, 0.99), percentile(alone_ms, 0.99)
    added = None if p99 is None or alone_p99 is None else p99 - alone_p99
    return [
        Row(f"{name}, median, ms", percentile(delays_ms, 0.5), "", percentile(alone_ms, 0.5), peer),
        Row(f"{name}, 99 %, ms", p99, "below 5", alone_p99, peer),
        Row(f"{name}, 99 %, what the daemon adds, ms", added, "below 3"),
    ]


async def figures(seconds: float) -> Figures:
    """Return all figures."""
    head: Figures = {
        "command": f"make bench SECONDS={seconds:g}",
        "measured": f"{datetime.now(UTC):%Y-%m-%d}, {os.cpu_count()} processors, {platform.machine()}, "
        f"Python {platform.python_version()}, onnxruntime {version('onnxruntime')}, "
        f"load average {os.getloadavg()[0]:.1f}",
    }
    rows = [
        Row("the interpreter: 200 000 turns of a loop, ms CPU", interpreter_ms()),
        *import_rows(),
        *await daemon_rows(seconds),
        *await frame_times(),
        *candump(seconds),
        *await queues(),
    ]
    return head | flat(rows)


def interpreter_ms() -> float:
    """Return the processor time of a fixed piece of Python, the least of nine: compares machines and interpreters."""
    statement = "for each in range(200_000): total += each % 7; found[each & 63] = total"
    return 1e3 * min(timeit.repeat(statement, "total, found = 0, {}", time.process_time, repeat=9, number=1))


def main() -> None:
    """Measure, print, and write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="time for each measurement of the daemon")
    found = asyncio.run(figures(parser.parse_args().seconds))
    FIGURES.parent.mkdir(parents=True, exist_ok=True)
    FIGURES.write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    for name, value in found.items():
        sys.stdout.write(f"{name:<60} {value if not isinstance(value, float) else round(value, 3)}\n")


if __name__ == "__main__":
    main()
