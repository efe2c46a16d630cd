"""The half minute itself: everything is started, the rover drives over a soil that changes, everything is stopped."""

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

from regolithd.calibration.models import TERRAIN_MODEL
from regolithd.calibration.parameters import SOILS
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.demo.broker import embedded_broker
from regolithd.daemon.demo.ground_truth_log import Witness
from regolithd.daemon.demo.viewer import Viewer
from regolithd.daemon.pipeline.terrain_network import Network as TerrainNetwork
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.scenario import Ground, Scenario, Stretch
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.daemon.wiring import equip
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.master.network import NodePhase
from regolithd.drivers.virtual import VirtualRover

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from regolithd.drivers.master.network import Network

CHANNEL = "demo"
RATE_HZ = 10.0
BOOT_WITHIN_S = 20.0
SPEED_M_S = 0.05
CHANGE_M = 0.75
WINDOW_S = 8.0
KNOWN_TO = {"gain_relative_std": 0.03, "no_load_current_std_A": 0.001}
"""As well as a wheels-up spin and a brake tell."""
FIRST, SECOND = "medium-soil", "lete-sand"


@dataclass(frozen=True, slots=True)
class Drive:
    """What is left of the drive."""

    witness: Witness
    viewer: Viewer
    recording: Path
    log: Path


def demo_configuration(folder: Path, passing: Path, port: int) -> Configuration:
    """Return Kapvik on an in-process bus, its drivetrain calibrated, recording into `folder`; `passing` is removed."""
    drivetrain = Scenario().drivetrain
    return Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": CHANNEL},
            "sync": {"rate_Hz": RATE_HZ},
            "nodes": {"inclinometer": 21, "ground_speed": 22, "motor_diagnostics": True},
            "drivetrain": drivetrain.model_dump() | KNOWN_TO,
            "posterior": {"window_s": WINDOW_S},
            "recording": {"directory": folder, "limit_MB": 50},
            "mqtt": {"host": "127.0.0.1", "port": port, "spool_directory": passing / "spool"},
            "control": {"socket": passing / "control.sock", "group": str(os.getgid())},
        }
    )


async def drive(folder: Path, seconds: float, show: Callable[[Viewer, float], None]) -> Drive:
    """Drive for so many seconds; `show` is called a few times a second with what the subscriber knows."""
    ground = Ground(stretches=(Stretch(soil=SOILS[FIRST], until_m=CHANGE_M), Stretch(soil=SOILS[SECOND])))
    world = VirtualWorld(Scenario(ground=ground))
    witness = Witness(world)
    async with (
        _temporary_folder() as passing,
        embedded_broker() as port,
        open_bus("virtual", CHANNEL) as rover_bus,
        asyncio.TaskGroup() as tasks,
    ):
        configuration = demo_configuration(folder, passing, port)
        prefix = f"{configuration.mqtt.prefix}/{configuration.rover.name}"
        viewer = Viewer(prefix)
        service = Service(configuration, TerrainNetwork(TERRAIN_MODEL))
        equip(service)
        service.outlets.append(witness)
        subscribed = asyncio.Event()
        lasting = [
            tasks.create_task(VirtualRover(world).run(rover_bus)),
            tasks.create_task(_subscribe(viewer, port, subscribed)),
        ]
        await subscribed.wait()
        running = tasks.create_task(service.run())
        network = await service.opened()
        async with asyncio.timeout(BOOT_WITHIN_S):
            await _operational(network)
        await network.enable()
        wheel_speed = SPEED_M_S / configuration.wheel.radius_m
        await network.set_speed((wheel_speed,) * 6)
        await _watch(viewer, seconds, show)
        await network.quick_stop()
        paths = service.recorder.paths if service.recorder else None
        running.cancel()
        await asyncio.wait([running])
        for task in lasting:
            task.cancel()
    if paths is None:
        raise OSError("the recording failed: " + (service.recorder.trouble or "" if service.recorder else ""))
    return Drive(witness, viewer, *paths)


@asynccontextmanager
async def _temporary_folder() -> AsyncIterator[Path]:
    with tempfile.TemporaryDirectory(prefix="regolithd-") as name:
        yield Path(name)


async def _operational(network: Network) -> None:
    """Wait for every node: one that was just switched on may be told to reset while it boots, and is tried again."""
    while any(each.phase is not NodePhase.OPERATIONAL for each in network.status.values()):  # noqa: ASYNC110  # no event
        await asyncio.sleep(0.05)


async def _subscribe(viewer: Viewer, port: int, subscribed: asyncio.Event) -> None:
    async with aiomqtt.Client("127.0.0.1", port, identifier="demo-viewer") as client:
        await client.subscribe(f"{viewer.prefix}/#")
        subscribed.set()
        async for message in client.messages:
            if isinstance(message.payload, bytes):
                viewer.take(str(message.topic), message.payload)


async def _watch(viewer: Viewer, seconds: float, show: Callable[[Viewer, float], None]) -> None:
    begun = time.monotonic()
    while (elapsed := time.monotonic() - begun) < seconds:
        show(viewer, elapsed)
        await asyncio.sleep(0.25)
    show(viewer, seconds)
