"""Nodes that nobody expects, two nodes with one id, and a second master: seen, and told once."""

from __future__ import annotations

import pytest
from rig import rig, until

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.master.events import NodeBooted, UnexpectedMaster, UnexpectedNode
from regolithd.drivers.master.intruders import ABSENT_NS, Intruders, IntruderWatch, Service, sender

CELL = NodeDescription(11, LOAD_CELL, 0)


@pytest.mark.parametrize(
    ("can_id", "node_id"),
    [
        *((0x000, 0), (0x080, 0), (0x100, 0), (0x0C4, 0x44), (0x1C4, 0x44), (0x244, 0), (0x2C4, 0x44), (0x4C4, 0x44)),
        *((0x544, 0), (0x5C4, 0x44), (0x644, 0), (0x744, 0x44), (0x7E4, 0), (0x580, 0)),
    ],
)
def test_who_sends_follows_from_the_predefined_connection_set(can_id: int, node_id: int) -> None:
    """EMCY, TPDOs, SDO answers and error control come from a node; RPDOs, SDO requests, SYNC, TIME and LSS do not."""
    assert sender(can_id) == node_id


def test_an_intruder_is_told_once_and_again_after_its_absence() -> None:
    """One event however often it sends; it is present until it has been silent for five seconds."""
    watch = IntruderWatch([11], master_id=127)
    found = watch.take(Frame(1, 0x744, b"\5"))
    assert isinstance(found, UnexpectedNode)
    assert found.node_id == 0x44
    assert "node 68 is on the bus, and not in the configuration (identifier 0x744)" in found.text
    assert watch.take(Frame(2, 0x1C4, b"")) is None
    assert watch.take(Frame(2, 0x70B, b"\5")) is None  # configured
    assert watch.take(Frame(2, 0x744, b"\5", extended=True)) is None
    assert watch.present(ABSENT_NS) == Intruders(nodes=(68,))
    assert watch.present(ABSENT_NS + 2) == Intruders()
    assert watch.take(Frame(ABSENT_NS + 3, 0x744, b"\5")) is not None


@pytest.mark.parametrize(
    ("frame", "service"),
    [
        (Frame(1, 0x080, b""), Service.SYNC),
        (Frame(1, 0x000, b"\x81\0"), Service.NMT),
        (Frame(1, 0x77F, b"\5"), Service.HEARTBEAT),
    ],
)
def test_a_second_master_is_told_with_what_it_does(frame: Frame, service: Service) -> None:
    """SYNC, NMT commands and the master's heartbeat of somebody else are each named, with a cure."""
    watch = IntruderWatch([11], master_id=127)
    found = watch.take(frame)
    assert isinstance(found, UnexpectedMaster)
    assert service.value in found.text
    assert found.remedy
    assert watch.present(2).services == (service,)


async def test_intruders_on_the_bus_are_events_of_the_network() -> None:
    """A foreign node, SYNC and NMT command are seen among the frames; our own and named nodes are not foreign."""
    async with rig([CELL], other_node_ids=frozenset({0x21})) as r:
        await r.wait_for_event(NodeBooted)
        assert r.network.intruders.present(r.frames[-1].time_ns) == Intruders()
        async with open_bus("virtual", r.bus.channel) as other:
            for can_id, data in ((0x721, b"\x7f"), (0x722, b"\x7f"), (0x080, b""), (0x000, b"\x01\x63")):
                await other.send(Frame(0, can_id, data))
            await until(lambda: len(r.events_of(UnexpectedMaster)) == 2, "SYNC and NMT of another master")
        assert [event.node_id for event in r.events_of(UnexpectedNode)] == [0x22]
