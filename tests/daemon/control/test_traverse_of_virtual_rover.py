"""Traverses of the virtual rover through the control socket: what its wheels really turned."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import pytest
from control_rig import GROUP, Client
from subscriber import until

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.control.protocol import Accepted
from regolithd.daemon.control.server import ControlSink
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.virtual import VirtualRover
from regolithd.drivers.virtual.plant import Bench

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path

    from regolithd.daemon.control.protocol import Ended

RATE_HZ = 10.0


@asynccontextmanager
async def driven(folder: Path) -> AsyncIterator[tuple[VirtualRover, ControlSink, Client]]:
    """Run virtual rover and daemon, and connect to its control socket."""
    socket = folder / "control.sock"
    configuration = Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": folder.name},
            "sync": {"rate_Hz": RATE_HZ},
            "nodes": {"heartbeat_timeout_ms": 3000},
            "recording": {"enabled": False},
            "control": {"socket": socket, "group": GROUP, "speed_limit_m_s": 1.0},
        }
    )
    service = Service(configuration, load_models(configuration))
    sink = ControlSink(configuration, lambda: service.network)
    service.sinks.append(sink)
    rover = VirtualRover(Bench(), configuration.described())
    async with open_bus("virtual", folder.name) as bus, asyncio.TaskGroup() as tasks:
        background = [tasks.create_task(rover.run(bus)), tasks.create_task(service.run())]
        network = await service.opened()
        await network.settled()
        await until(socket.exists)
        client = await Client.to(socket)
        yield rover, sink, client
        client.writer.close()
        for task in reversed(background):
            task.cancel()
            await asyncio.wait([task])
    Client.opened.clear()


async def ended(client: Client, distance_m: float, speed_m_s: float) -> Ended:
    """Drive a traverse, and return its end."""
    accepted = await client.ask({"command": "traverse", "distance_m": distance_m, "speed_m_s": speed_m_s})
    assert isinstance(accepted, Accepted)
    return await client.hear_end()


@pytest.mark.timeout(60)
async def test_the_end_of_a_traverse_says_what_the_wheels_turned(tmp_path: Path) -> None:
    """A sound rover turns the distance; a speed above 0x607F is refused; a wheel that ignores its RPDO is named."""
    async with driven(tmp_path) as (rover, sink, client):
        end = await ended(client, 0.05, 0.05)
        assert (end.ending, end.text) == ("finished", "the traverse is complete")
        assert end.turned_m == pytest.approx(0.05, abs=0.05 / RATE_HZ)

        end = await ended(client, 1.0, 0.1)
        assert (end.ending, end.turned_m) == ("quick-stopped", pytest.approx(0.0, abs=0.001))
        assert "more than object 0x607F allows (node 1 1047.2, node 2" in end.text

        assert rover.inject_fault("deaf 3") == "ok"
        end = await ended(client, 1.0, 0.022)
        assert end.ending == "quick-stopped"
        assert end.text == "commanded to turn at 0.293 rad/s, and measured: wheel 3 (node 3) at 0.000 rad/s"
        assert end.turned_m < 0.1
        assert sink.wheel_problem == end.text
