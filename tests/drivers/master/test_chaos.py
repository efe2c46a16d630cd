"""Random faults: the network continues, and once they are cleared, all nodes are operational."""

from __future__ import annotations

import asyncio
import random

import pytest
from rig import Rig, rig, until

from regolithd.drivers.devices.inclinometer import INCLINOMETER
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import DriverError

NODES = (
    NodeDescription(1, MOTOR_CONTROLLER, 0),
    NodeDescription(2, MOTOR_CONTROLLER, 1),
    NodeDescription(11, LOAD_CELL, 0),
    NodeDescription(21, INCLINOMETER, None),
)
FAULTS = (
    "off {}",
    "on {}",
    "reset {}",
    "leave {}",
    "clear {}",
    "silent {}",
    "deaf {}",
    "no-sdo {}",
    "no-heartbeat {}",
    "no-boot-up {}",
    "short {} 2",
    "slow {} 30",
    "emcy {} 0x4210",
    "identity {} product 0x999",
    "refuse {} 0x1017",
    "forget {} 0x1800",
)


@pytest.mark.parametrize("seed", range(4))
async def test_the_network_recovers_from_random_faults(seed: int) -> None:
    """After thirty faults and commands at random moments, all nodes become operational once the faults are cleared."""
    chance = random.Random(seed)
    async with rig(NODES, retry_after_s=0.3, retry_at_most_s=0.6, sdo_timeout_s=0.2, node_lost_after_s=0.6) as r:
        for _ in range(30):
            if chance.random() < 0.3:
                await command(r, chance)
            r.rover.inject_fault(chance.choice(FAULTS).format(chance.choice(NODES).node_id))
            await asyncio.sleep(chance.random() * 0.15)
            assert not r.running.done()
        for line in ("clear all", "off all", "on all"):
            assert r.rover.inject_fault(line) == "ok"
        await until(
            lambda: all(status.phase == "operational" for status in r.network.status.values()), "all operational", 40
        )
        await drive(r)


async def drive(r: Rig) -> None:
    """Drive and stop."""
    await r.network.enable()
    await r.network.set_speed((0.1, 0.1, 0, 0, 0, 0))
    await until(lambda: r.rover.nodes[1].device.speed_rad_s > 0, "wheel 1 turning")
    await r.network.disable()
    assert r.rover.nodes[1].device.speed_rad_s == 0.0


async def command(r: Rig, chance: random.Random) -> None:
    """Give a command; it may fail with a `DriverError` only."""
    what = chance.choice(["enable", "set_speed", "quick_stop", "disable"])
    try:
        async with asyncio.timeout(1.0):
            await getattr(r.network, what)(*([(0.1,) * 6] if what == "set_speed" else []))
    except (DriverError, TimeoutError):
        pass
