"""A daemon and its virtual rover, which drives, in one process on an in-process bus: for tests of what it publishes.

    python tests/bench/driving_daemon.py ROVER_TOML SCENARIO_TOML

Prints a line once the wheels turn; they turn until the process ends. `rover.sock`, beside the first file, takes the
faults of `drivers.virtual.fault_injection`.
"""

from __future__ import annotations

import asyncio
import signal
import sys
from contextlib import AsyncExitStack
from pathlib import Path

from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.scenario import read_scenario
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.daemon.wiring import connect_sinks, open_stores
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.master.network import NodePhase
from regolithd.drivers.virtual import VirtualRover
from regolithd.drivers.virtual.fault_socket import fault_socket

SPEED_M_S = 0.05


async def main(rover: Path, scenario: Path) -> None:
    """Drive until SIGTERM."""
    configuration = read_configuration(rover)
    world = VirtualWorld(read_scenario(scenario))
    async with (
        AsyncExitStack() as faults,
        open_bus("virtual", configuration.bus.channel) as bus,
        asyncio.TaskGroup() as tasks,
    ):
        service = Service(configuration, load_models(configuration))
        connect_sinks(service, open_stores(service.configuration.mqtt))
        virtual = VirtualRover(world)
        await faults.enter_async_context(fault_socket(virtual, rover.parent / "rover.sock"))
        simulating = tasks.create_task(virtual.run(bus))
        running = tasks.create_task(service.run())
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, running.cancel)
        network = await service.opened()
        while any(each.phase is not NodePhase.OPERATIONAL for each in network.status.values()):  # noqa: ASYNC110
            await asyncio.sleep(0.05)
        await network.enable()
        await network.set_speed((SPEED_M_S / configuration.wheel.radius_m,) * 6)
        print("driving", flush=True)
        await asyncio.wait([running])
        simulating.cancel()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), Path(sys.argv[2])))
