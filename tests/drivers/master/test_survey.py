"""The survey of a bus, and the trial of a boot configuration: what is there, and what differs; nothing is changed."""

from __future__ import annotations

import asyncio
import itertools
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from described import load_cell, motor

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.profiles.choice import DeviceChoice
from regolithd.drivers.master.scan import scan
from regolithd.drivers.master.survey import Survey
from regolithd.drivers.virtual.plant import Bench
from regolithd.drivers.virtual.rover import VirtualRover

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.devices.node import NodeDescription

CHANNELS = itertools.count()
MOTOR, CELL = motor(DeviceChoice("epos4"), 3, 2), load_cell(DeviceChoice("cia404"), 14, 3)


@asynccontextmanager
async def powered(*rovers: VirtualRover) -> AsyncIterator[Bus]:
    """Power virtual nodes, and yield another bus on their channel."""
    channel = f"survey-{next(CHANNELS)}"
    async with asyncio.TaskGroup() as tasks:
        buses = [open_bus("virtual", channel) for _ in range(len(rovers) + 1)]
        opened = [await each.__aenter__() for each in buses]
        running = [tasks.create_task(rover.run(bus)) for rover, bus in zip(rovers, opened[1:], strict=True)]
        await asyncio.sleep(0.1)
        try:
            yield opened[0]
        finally:
            for task in running:
                task.cancel()
            await asyncio.gather(*running, return_exceptions=True)
            for each in buses:
                await each.__aexit__(None, None, None)


def changed(node: NodeDescription, key: tuple[int, int], **fields: object) -> VirtualRover:
    """Return a rover with one node whose object differs from its EDS; without fields it lacks the object."""
    rover = VirtualRover(Bench(), [node])
    dictionary = rover.nodes[node.node_id].dictionary
    entries = dict(dictionary.entries)
    entry = entries.pop(key)
    if fields:
        entries[key] = replace(entry, **fields)
    dictionary.entries = entries
    return rover


def configured(rover: VirtualRover) -> dict[int, dict[tuple[int, int], object]]:
    """Return the communication objects of every node."""
    return {
        key: {place: value for place, value in node.dictionary.values.items() if 0x1005 <= place[0] < 0x2000}
        for key, node in rover.nodes.items()
    }


async def test_every_node_is_found_with_identity_state_and_errors() -> None:
    """Nodes that answer are named; one that only sends is there too; a heartbeat is not needed."""
    rover = VirtualRover(Bench(), [MOTOR, CELL])
    async with powered(rover) as bus:
        rover.inject_fault("emcy 3 0x3220")
        survey = asyncio.ensure_future(Survey(bus, sdo_timeout_s=0.05, listen_s=0.4).run())
        await asyncio.sleep(0.2)
        bus_of_rover = rover.nodes[3]
        assert bus_of_rover.counts["sdo"] > 0
        found = {node.node_id: node for node in await survey}
    assert sorted(found) == [3, 14]
    drive = found[3]
    assert (drive.profile_number, drive.identity.vendor, drive.errors) == (402, 0xFB, (0x3220,))
    assert drive.error_register
    assert not drive.shared
    assert (found[14].profile_number, found[14].errors) == (404, ())
    assert drive.nmt_state in {None, NmtState.PRE_OPERATIONAL}


async def test_two_nodes_with_one_id_are_found() -> None:
    """One request brings two answers."""
    async with powered(VirtualRover(Bench(), [CELL]), VirtualRover(Bench(), [CELL])) as bus:
        (found,) = await Survey(bus, sdo_timeout_s=0.05, listen_s=0.1).run()
    assert (found.node_id, found.shared) == (14, True)


async def test_a_node_that_only_sends_is_found() -> None:
    """Its heartbeat tells the state; it has no identity."""
    async with powered(VirtualRover(Bench(), [])) as bus, open_bus("virtual", bus.channel) as other:
        survey = asyncio.ensure_future(Survey(bus, sdo_timeout_s=0.05, listen_s=0.2).run())
        await asyncio.sleep(0.05)
        await other.send(Frame(0, 0x732, b"\x05"))
        (found,) = await survey
    assert (found.node_id, found.nmt_state, found.identity) == (0x32, NmtState.OPERATIONAL, None)


async def test_a_node_as_described_has_no_differences() -> None:
    """The whole list of writes is tried against a device that has every object; it is told what cannot be checked."""
    rover = VirtualRover(Bench(), [MOTOR, CELL])
    async with powered(rover) as bus:
        before = configured(rover)
        found = await scan(bus, [MOTOR, CELL], listen_s=0.1)
        assert [(each.problem, each.differences) for each in found] == [("", ()), ("", ())]
        assert "product" in found[0].reservations
        assert configured(rover) == before


@pytest.mark.parametrize(
    ("node", "key", "fields", "said"),
    [
        (MOTOR, (0x1016, 1), {}, "0x1016:01 is in the EDS, and the device does not have it"),
        (MOTOR, (0x30D1, 2), {}, "0x30D1:02 is to be mapped, and the device does not have it"),
        (MOTOR, (0x1017, 0), {"format": "I"}, "0x1017:00 has 16 bits in the EDS, and 32 in the device"),
        (MOTOR, (0x1005, 0), {"default": 0x90}, "0x1005:00 cannot be written, must be 0x80, and reads 0x90"),
        (MOTOR, (0x60A9, 0), {"default": 7}, "unit: 0x60A9:00 = 0x7: no angle per time"),
        (CELL, (0x6132, 1), {}, "0x6132:01 states a unit, and cannot be read"),
    ],
)
async def test_what_differs_from_the_file_is_said_before_the_boot(
    node: NodeDescription, key: tuple[int, int], fields: dict[str, object], said: str
) -> None:
    """An object that the device lacks, has in another size, or fixed to another value is named by `check`."""
    async with powered(changed(node, key, **fields)) as bus:
        (found,) = await scan(bus, [node], listen_s=0.05)
    assert any(said in text for text in found.differences), found
