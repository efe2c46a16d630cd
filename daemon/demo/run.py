"""Run the demo: virtual rover, daemon, broker and subscriber in one process drive over the border of two soils."""

from __future__ import annotations

import asyncio
import os
import tempfile
import time
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import aiomqtt

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.demo.broker import embedded_broker
from regolithd.daemon.demo.fast_forward import LaterWorld, fast_forward
from regolithd.daemon.demo.ground_truth_log import GroundTruthLog
from regolithd.daemon.demo.live_table import LiveTable
from regolithd.daemon.demo.story import SPEED_M_S, fast_part, story_scenario
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.daemon.wiring import connect_sinks, open_stores
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.master.network import NodePhase
from regolithd.drivers.virtual import VirtualRover

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from regolithd.drivers.master.network import Network

CHANNEL = "demo"
RATE_HZ = 4.0
"""Two snapshots in each half second, over which the alarm averages."""
BOOT_TIMEOUT_S = 20.0
BOOT_S = 2.0
"""Between the computed part and the live one, for the times in the recording."""
WINDOW_S = 8.0
CALIBRATION = {
    "gain_relative_std": 0.03,
    "no_load_current_std_A": 0.001,
    "viscous_current_A_s_per_rad": 0.0,  # the virtual rover has one: it is concealed from the daemon
}
"""What the daemon is told of the drivetrain: standard deviations that a wheels-up spin and a brake test reach."""


@dataclass(frozen=True, slots=True)
class DemoRun:
    """Results of one run: estimates beside the ground truth, and the paths of MCAP recording and candump log."""

    ground_truth: GroundTruthLog
    live_from_ns: int
    recording: Path
    log: Path


@dataclass(frozen=True, slots=True)
class Show:
    """Where the demo shows its progress: seconds computed of all, and the live table with the seconds elapsed."""

    computing: Callable[[float, float], None]
    driving: Callable[[LiveTable, float], None]


def demo_configuration(folder: Path, temporary: Path, port: int) -> Configuration:
    """Return Kapvik on an in-process bus with a calibrated drivetrain, recording into `folder`.

    Spool and control socket go into `temporary`, which is removed afterwards; `port` is the broker's.
    """
    drivetrain = Configuration().drivetrain.model_dump() | {"no_load_current_A": (0.037,) * 6} | CALIBRATION
    return Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": CHANNEL},
            "sync": {"rate_Hz": RATE_HZ},
            "nodes": {"inclinometer": 21, "ground_speed": 22, "motor_diagnostics": True},
            "drivetrain": drivetrain,
            "posterior": {"window_s": WINDOW_S},
            "recording": {"directory": folder, "limit_MB": 500},
            "mqtt": {"host": "127.0.0.1", "port": port, "spool_directory": temporary / "spool"},
            "control": {"socket": temporary / "control.sock", "group": str(os.getgid())},
        }
    )


async def run_demo(folder: Path, seconds: float, show: Show) -> DemoRun:
    """Compute the long drive, then drive live for `seconds` across the border."""
    async with (
        _temporary_folder() as temporary,
        embedded_broker() as port,
        open_bus("virtual", CHANNEL) as rover_bus,
        asyncio.TaskGroup() as tasks,
    ):
        configuration = demo_configuration(folder, temporary, port)
        fast = fast_part(RATE_HZ, configuration.wheel.radius_m)
        world = VirtualWorld(story_scenario(fast))
        truth = GroundTruthLog(world)
        service = Service(configuration, load_models(configuration))
        duration_s = len(fast.time_s) / RATE_HZ
        start_ns = time.time_ns() - int((duration_s + BOOT_S) * 1e9)
        for computed_s in fast_forward(fast, world, service, truth, start_ns):
            show.computing(computed_s, duration_s)
            await asyncio.sleep(0)
        table = LiveTable(f"{configuration.mqtt.prefix}/{configuration.rover.name}", world)
        connect_sinks(service, open_stores(configuration.mqtt))
        service.sinks.append(truth)
        subscribed = asyncio.Event()
        background = [
            tasks.create_task(VirtualRover(LaterWorld(world, duration_s)).run(rover_bus)),
            tasks.create_task(_subscribe(table, port, subscribed)),
        ]
        await subscribed.wait()
        live_from_ns = time.time_ns()
        running = tasks.create_task(service.run())
        await _drive(await service.opened(), configuration, table, seconds, show)
        paths = service.recorder.paths if service.recorder else None
        running.cancel()
        await asyncio.wait([running])
        for task in background:
            task.cancel()
    if paths is None:
        raise OSError("the recording failed: " + (service.recorder.problem or "" if service.recorder else ""))
    return DemoRun(truth, live_from_ns, *paths)


async def _drive(network: Network, configuration: Configuration, table: LiveTable, seconds: float, show: Show) -> None:
    """Boot the nodes, drive for `seconds`, stop."""
    async with asyncio.timeout(BOOT_TIMEOUT_S):
        await _operational(network)
    await network.enable()
    await network.set_speed((SPEED_M_S / configuration.wheel.radius_m,) * 6)
    await _show_repeatedly(table, seconds, show.driving)
    await network.quick_stop()


@asynccontextmanager
async def _temporary_folder() -> AsyncIterator[Path]:
    with tempfile.TemporaryDirectory(prefix="regolithd-") as name:
        yield Path(name)


async def _operational(network: Network) -> None:
    """Wait until every node is operational; a failed boot is retried by the network."""
    while any(each.phase is not NodePhase.OPERATIONAL for each in network.status.values()):  # noqa: ASYNC110  # no event
        await asyncio.sleep(0.05)


async def _subscribe(table: LiveTable, port: int, subscribed: asyncio.Event) -> None:
    async with aiomqtt.Client("127.0.0.1", port, identifier="demo-viewer") as client:
        await client.subscribe(f"{table.prefix}/#")
        subscribed.set()
        async for message in client.messages:
            if isinstance(message.payload, bytes):
                table.take(str(message.topic), message.payload)


async def _show_repeatedly(table: LiveTable, seconds: float, show: Callable[[LiveTable, float], None]) -> None:
    begun = time.monotonic()
    while (elapsed := time.monotonic() - begun) < seconds:
        show(table, elapsed)
        await asyncio.sleep(0.25)
    show(table, seconds)
