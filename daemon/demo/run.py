"""Run the demo: start virtual rover, daemon, broker and subscriber, drive over two soils, stop everything."""

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

from regolithd.calibration.parameters import SOILS
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.demo.broker import embedded_broker
from regolithd.daemon.demo.ground_truth_log import GroundTruthLog
from regolithd.daemon.demo.live_table import LiveTable
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.scenario import Ground, Scenario, Stretch
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.daemon.wiring import connect_sinks
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.master.network import NodePhase
from regolithd.drivers.virtual import VirtualRover

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from regolithd.drivers.master.network import Network

CHANNEL = "demo"
RATE_HZ = 10.0
BOOT_TIMEOUT_S = 20.0
SPEED_M_S = 0.05
SOIL_CHANGE_M = 0.75
"""Where the second soil begins, from where the rover's middle starts."""
WINDOW_S = 8.0
CALIBRATION_STD = {"gain_relative_std": 0.03, "no_load_current_std_A": 0.001}
"""Standard deviations that a wheels-up spin and a brake test reach."""
SOILS_DRIVEN = ("medium-soil", "lete-sand")


@dataclass(frozen=True, slots=True)
class DemoRun:
    """Results of one run: estimates beside the ground truth, and the paths of MCAP recording and candump log."""

    ground_truth: GroundTruthLog
    recording: Path
    log: Path


def demo_configuration(folder: Path, temporary: Path, port: int) -> Configuration:
    """Return Kapvik on an in-process bus with a calibrated drivetrain, recording into `folder`.

    Spool and control socket go into `temporary`, which is removed afterwards; `port` is the broker's.
    """
    drivetrain = Scenario().drivetrain
    return Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": CHANNEL},
            "sync": {"rate_Hz": RATE_HZ},
            "nodes": {"inclinometer": 21, "ground_speed": 22, "motor_diagnostics": True},
            "drivetrain": drivetrain.model_dump() | CALIBRATION_STD,
            "posterior": {"window_s": WINDOW_S},
            "recording": {"directory": folder, "limit_MB": 50},
            "mqtt": {"host": "127.0.0.1", "port": port, "spool_directory": temporary / "spool"},
            "control": {"socket": temporary / "control.sock", "group": str(os.getgid())},
        }
    )


async def run_demo(folder: Path, seconds: float, show: Callable[[LiveTable, float], None]) -> DemoRun:
    """Drive for `seconds`; `show` is called four times a second with the subscriber's table and the elapsed seconds."""
    first, second = SOILS_DRIVEN
    ground = Ground(stretches=(Stretch(soil=SOILS[first], until_m=SOIL_CHANGE_M), Stretch(soil=SOILS[second])))
    world = VirtualWorld(Scenario(ground=ground))
    ground_truth = GroundTruthLog(world)
    async with (
        _temporary_folder() as temporary,
        embedded_broker() as port,
        open_bus("virtual", CHANNEL) as rover_bus,
        asyncio.TaskGroup() as tasks,
    ):
        configuration = demo_configuration(folder, temporary, port)
        prefix = f"{configuration.mqtt.prefix}/{configuration.rover.name}"
        table = LiveTable(prefix)
        service = Service(configuration, load_models(configuration))
        connect_sinks(service)
        service.sinks.append(ground_truth)
        subscribed = asyncio.Event()
        background = [
            tasks.create_task(VirtualRover(world).run(rover_bus)),
            tasks.create_task(_subscribe(table, port, subscribed)),
        ]
        await subscribed.wait()
        running = tasks.create_task(service.run())
        network = await service.opened()
        async with asyncio.timeout(BOOT_TIMEOUT_S):
            await _operational(network)
        await network.enable()
        wheel_speed = SPEED_M_S / configuration.wheel.radius_m
        await network.set_speed((wheel_speed,) * 6)
        await _show_repeatedly(table, seconds, show)
        await network.quick_stop()
        paths = service.recorder.paths if service.recorder else None
        running.cancel()
        await asyncio.wait([running])
        for task in background:
            task.cancel()
    if paths is None:
        raise OSError("the recording failed: " + (service.recorder.problem or "" if service.recorder else ""))
    return DemoRun(ground_truth, *paths)


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
