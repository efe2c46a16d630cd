"""The virtual nodes' communication profile, to the nanosecond of the simulated clock and to the bit."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING

import pytest
from virtual_master import LOAD_CELL_TPDO, MASTER_ID, AbortedError, Master

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.virtual.node import BOOT_NS, VirtualNmtState
from regolithd.drivers.virtual.pdo import concerns_pdos, usable
from regolithd.drivers.virtual.rover import IDLE_STEP_NS, KAPVIK, MOVING_STEP_NS, VirtualRover

if TYPE_CHECKING:
    from regolithd.drivers.virtual.node import VirtualNode

MS = 1_000_000
NODE = 11
BOOT_UP = (0x700 + NODE, b"\0")


class Alone:
    """Load cell 11 alone; its frames with the time at which they are due."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, int, bytes]] = []
        self.rover = VirtualRover(_Nothing(), [each for each in KAPVIK if each.node_id == NODE])
        self.node: VirtualNode = self.rover.nodes[NODE]
        self.node._emit = lambda due, can_id, data: self.frames.append((due, can_id, data))
        self.node.power_on(0)
        self.node.tick(BOOT_NS)

    def send(self, can_id: int, data: bytes, now: int) -> None:
        """Let the node receive a frame."""
        self.node.receive(Frame(0, can_id, data), now)

    def write(self, index: int, sub: int, value: int, now: int) -> None:
        """Write an object by SDO."""
        bits = self.node.dictionary.entries[index, sub].bits
        size = bits // 8
        data = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub) + value.to_bytes(4, "little")
        self.send(0x600 + NODE, data, now)
        assert self.frames.pop()[2][0] == 0x60

    def take(self) -> list[tuple[int, bytes]]:
        """Return identifiers and data of the frames since the last call."""
        found = [(can_id, data) for _, can_id, data in self.frames]
        self.frames.clear()
        return found


class _Nothing:
    """A plant that is never measured."""


@pytest.fixture
def alone() -> Alone:
    """A load cell that has just booted up."""
    one = Alone()
    assert one.take() == [BOOT_UP]
    return one


def test_a_node_boots_up_20_ms_after_power_on_and_not_before() -> None:
    """Until then it is initialising, and neither hears nor sends."""
    one = Alone()
    one.take()
    one.node.power_off()
    one.node.power_on(1000)
    one.node.power_on(5000)  # it is on already
    assert one.node.due() == 1000 + BOOT_NS == 1000 + 20 * MS
    one.send(0x000, b"\x01\x00", 1500)
    one.node.tick(1000 + BOOT_NS - 1)
    assert (one.node.state, one.take()) == (VirtualNmtState.INITIALISING, [])
    one.node.tick(1000 + BOOT_NS)
    assert (one.node.state, one.take()) == (VirtualNmtState.PRE_OPERATIONAL, [BOOT_UP])
    assert one.node.due() is None


@pytest.mark.parametrize(
    ("data", "state"),
    [
        (b"\x01\x0b", VirtualNmtState.OPERATIONAL),
        (b"\x01\x00", VirtualNmtState.OPERATIONAL),
        (b"\x02\x0b", VirtualNmtState.STOPPED),
        (b"\x80\x0b", VirtualNmtState.PRE_OPERATIONAL),
        (b"\x81\x0b", VirtualNmtState.INITIALISING),
        (b"\x82\x00", VirtualNmtState.INITIALISING),
        (b"\x01\x0c", VirtualNmtState.PRE_OPERATIONAL),  # for another node
        (b"\x01\x01", VirtualNmtState.PRE_OPERATIONAL),
        (b"\x01", VirtualNmtState.PRE_OPERATIONAL),  # too short
        (b"\x83\x0b", VirtualNmtState.PRE_OPERATIONAL),  # not defined
    ],
)
def test_an_nmt_command_is_for_one_node_or_all(alone: Alone, data: bytes, state: VirtualNmtState) -> None:
    """The second byte is the node-ID, 0 for all; other commands and lengths have no effect."""
    alone.send(0x000, data, 30 * MS)
    assert alone.node.state is state
    assert alone.node.counts["nmt"] == (data[1:] in (b"\x0b", b"\x00"))


def test_a_node_counts_what_it_receives_and_sends() -> None:
    """Each request, SYNC, PDO and EMCY message, since it was made."""
    master = Master()
    node = master.node(NODE)
    before = dict(node.counts)
    master.write(NODE, 0x1017, 0, 0, 2)
    assert node.counts["sdo"] == before.get("sdo", 0) + 1
    master.configure(NODE, tpdo=LOAD_CELL_TPDO, kind=1)
    master.nmt(1)
    for _ in range(3):
        master.sync()
    node.report(0x5000)
    found = {
        name: node.counts[name] - before.get(name, 0) for name in ("boot_up", "nmt", "sync", "tpdo", "emcy", "rpdo")
    }
    assert found == {"boot_up": 0, "nmt": 1, "sync": 3, "tpdo": 3, "emcy": 1, "rpdo": 0}


@pytest.mark.parametrize(("command", "kept"), [(0x81, False), (0x82, True)])
def test_resetting_communication_keeps_the_application_objects(alone: Alone, command: int, kept: bool) -> None:
    """Objects from 0x2000 on keep their values; those of 0x1000 to 0x1FFF return to the EDS's in either case."""
    alone.write(0x6112, 1, 0, 30 * MS)
    alone.write(0x1017, 0, 100, 30 * MS)
    before = alone.node.dictionary.entries[0x6112, 1].default
    alone.send(0x000, bytes((command, NODE)), 40 * MS)
    assert before != 0
    assert alone.node.dictionary.get(0x6112, 1) == (0 if kept else before)
    assert alone.node.dictionary.get(0x1017) == 0
    alone.node.tick(40 * MS + BOOT_NS)
    assert alone.take() == [BOOT_UP]


def test_heartbeats_keep_their_phase_and_are_not_caught_up(alone: Alone) -> None:
    """The period (0x1017) is in milliseconds; after a pause one heartbeat is sent, and the next a period later."""
    alone.write(0x1017, 0, 100, 30 * MS)
    sent = []
    for now_ms in (129, 130, 131, 235, 329, 330, 700, 799, 800):
        alone.node.tick(now_ms * MS)
        sent += [now_ms for _ in alone.take()]
    assert sent == [130, 235, 330, 700, 800]
    assert alone.node.due() == 900 * MS
    assert alone.node.counts["heartbeat"] == 5
    alone.write(0x1017, 0, 0, 800 * MS)
    assert alone.node.due() is None


def test_a_heartbeat_reports_the_nmt_state(alone: Alone) -> None:
    """0x7F pre-operational, 0x05 operational, 0x04 stopped."""
    alone.write(0x1017, 0, 10, 30 * MS)
    states = []
    for number, command in enumerate((0x80, 0x01, 0x02), start=1):
        now = 30 * MS + number * 10 * MS
        alone.send(0x000, bytes((command, NODE)), now - 1)
        alone.node.tick(now)
        states += alone.take()
    assert states == [(0x70B, b"\x7f"), (0x70B, b"\x05"), (0x70B, b"\x04")]


@pytest.mark.parametrize(
    ("behaviour", "state"),
    [(0, VirtualNmtState.PRE_OPERATIONAL), (1, VirtualNmtState.OPERATIONAL), (2, VirtualNmtState.STOPPED)],
)
def test_the_masters_loss_has_the_reaction_of_object_0x1029(behaviour: int, state: VirtualNmtState) -> None:
    """Monitoring begins with the first heartbeat, ends after the time of 0x1016, and the master's return ends it."""
    master = Master([each for each in KAPVIK if each.node_id == 1])
    node = master.node(1)
    master.write(1, 0x1029, 1, behaviour, 1)
    master.write(1, 0x1016, 1, MASTER_ID << 16 | 200, 4)
    master.nmt(1)
    master.wait(1.0)
    assert node.state is VirtualNmtState.OPERATIONAL
    master.heartbeat()
    assert node.due() == master.now + 200 * MS
    node.tick(master.now + 200 * MS - 1)
    assert node.counts["master_lost"] == 0
    node.tick(master.now + 200 * MS)
    assert node.counts["master_lost"] == 1
    assert node.state is state
    assert node.due() is None


def test_a_node_that_is_not_operational_stays_where_it_is_when_the_master_is_lost() -> None:
    """Pre-operational is kept, and the heartbeat of another node is not the master's."""
    master = Master()
    master.write(1, 0x1016, 1, MASTER_ID << 16 | 200, 4)
    master.send(0x700 + 126, b"\x05")
    assert master.node(1)._master_due is None
    master.heartbeat()
    master.nmt(2, 1)
    master.wait(0.3)
    assert master.node(1).counts["master_lost"] == 1
    assert master.node(1).state is VirtualNmtState.STOPPED


def test_a_stopped_node_answers_no_sdo(alone: Alone) -> None:
    """In pre-operational and operational it does."""
    for command, answers in ((0x01, 1), (0x02, 0), (0x80, 1)):
        alone.send(0x000, bytes((command, NODE)), 30 * MS)
        alone.send(0x600 + NODE, bytes.fromhex("4000100000000000"), 30 * MS)
        assert len(alone.take()) == answers


@pytest.mark.parametrize("field", ["extended", "remote", "error"])
def test_frames_of_other_kinds_are_ignored(alone: Alone, field: str) -> None:
    """29-bit identifiers, remote frames and error frames are not for these nodes."""
    alone.node.receive(Frame(0, 0x000, b"\x01\x0b")._replace(**{field: True}), 30 * MS)
    assert alone.node.state is VirtualNmtState.PRE_OPERATIONAL


def test_inhibit_and_event_times_have_their_units() -> None:
    """0x1800:03 is in 0.1 ms, 0x1800:05 in ms; an event-driven PDO is sent when its value has changed."""
    master = Master([each for each in KAPVIK if each.node_id == NODE])
    master.write(NODE, 0x1800, 1, 0x8000_018B, 4)
    master.write(NODE, 0x1800, 3, 300, 2)
    master.configure(NODE, tpdo=LOAD_CELL_TPDO, kind=255)
    master.write(NODE, 0x1800, 5, 50, 2)
    (compiled,) = master.node(NODE)._transmit
    assert (compiled.inhibit_ns, compiled.event_ns) == (30 * MS, 50 * MS)
    master.nmt(1)
    start = master.now
    assert master.node(NODE).due() == start + 50 * MS
    device_measures = master.node(NODE).measure
    measurement = master.rover._plant.measure(0.0, [0.0] * 6)
    device_measures(measurement, start + 30 * MS - 1)
    assert master.rover.outgoing(start + 30 * MS) == []
    device_measures(measurement, start + 30 * MS)
    assert [frame.can_id for frame in master.rover.outgoing(start + 30 * MS)] == [0x18B]
    device_measures(measurement, start + 90 * MS)  # it has not changed
    assert master.rover.outgoing(start + 90 * MS) == []


@pytest.mark.parametrize(
    ("cob_id", "allowed"),
    [
        (0x000, False),
        (0x080, False),
        (0x081, True),
        (0x100, True),
        (0x101, False),
        (0x180, False),
        (0x181, True),
        (0x580, True),
        (0x581, False),
        (0x5FF, False),
        (0x600, True),
        (0x601, False),
        (0x67F, False),
        (0x680, True),
        (0x6DF, True),
        (0x6E0, False),
        (0x7FF, False),
        (0x2000_0181, False),
        (0x8000_0181, True),
    ],
)
def test_no_pdo_uses_a_reserved_identifier(cob_id: int, allowed: bool) -> None:
    """CiA 301, table 40: NMT, SYNC, TIME, SDO and error control are reserved; 29-bit identifiers are not supported."""
    assert usable(cob_id) is allowed


def test_the_objects_of_the_pdos() -> None:
    """0x1400 to 0x1BFF describe PDOs, and nothing else does."""
    assert [concerns_pdos(index) for index in (0x13FF, 0x1400, 0x1A00, 0x1BFF, 0x1C00)] == [
        False,
        True,
        True,
        True,
        False,
    ]


@pytest.mark.parametrize("value", [0x0000_0000, 0x2000_0080, 0x4000_0080, 0x0000_0800])
def test_a_sync_of_another_kind_is_refused(value: int) -> None:
    """A producer, a 29-bit identifier, and the identifier 0 are invalid values of 0x1005."""
    master = Master()
    with pytest.raises(AbortedError, match="0x06090030"):
        master.write(1, 0x1005, 0, value, 4)


def test_the_rover_steps_often_only_while_a_drive_moves() -> None:
    """Every 20 ms while a drive is enabled, else every 200 ms, and not for three SYNC intervals after a SYNC."""
    assert (MOVING_STEP_NS, IDLE_STEP_NS) == (20 * MS, 200 * MS)
    master = Master()
    master.wait(0.5)
    due = master.rover._step_due
    assert due - master.now <= 200 * MS
    master.rover.tick(due)
    assert master.rover._step_due == due + 200 * MS
    for controlword in (0x06, 0x07, 0x0F):
        master.write(1, 0x6040, 0, controlword, 2)
    master.rover.tick(due + 200 * MS)
    assert master.rover._step_due == due + 220 * MS
    master.sync()
    assert master.rover._step_due == master.now + 200 * MS
    master.now += 100 * MS
    master.sync()
    assert master.rover._step_due == master.now + 300 * MS


def test_a_step_of_the_wall_clock_is_limited() -> None:
    """A frame from a little before the last one changes nothing, and no step is longer than 5 s in either direction."""
    second = 1_000_000_000
    rover = VirtualRover(_Nothing(), ())
    times = []
    for wall_s in (100.0, 101.5, 101.5, 100.0, 110.0, 104.0, 104.5):
        rover._advance(round(wall_s * second))
        times.append(rover._time_s)
    assert times == [0.0, 1.5, 1.5, 1.5, 6.5, 6.5, 7.0]


def test_counts_are_told_by_node_and_for_the_bus() -> None:
    """As JSON too, by the command `counts`; what is told is a copy."""
    alone = Alone()
    alone.send(0x000, bytes([0x01, NODE]), BOOT_NS)
    counts = alone.rover.counts()
    assert set(counts) == {"bus", str(NODE)}
    assert counts[str(NODE)]["nmt"] == 1
    assert json.loads(alone.rover.inject_fault("counts")) == counts
    counts[str(NODE)]["nmt"] = 9
    assert alone.node.counts["nmt"] == 1


def test_what_is_not_delayed_is_due_at_once(alone: Alone) -> None:
    """Heartbeats and SDO answers; a frame with a time would wait for it."""
    alone.write(0x1017, 0, 100, 2 * BOOT_NS)
    alone.node.tick(3 * BOOT_NS + 200_000_000)
    alone.send(0x600 + NODE, bytes((0x40, 0x00, 0x10, 0, 0, 0, 0, 0)), 4 * BOOT_NS)
    assert {due for due, _, _ in alone.frames} == {0}
    assert {can_id for _, can_id, _ in alone.frames} == {0x700 + NODE, 0x580 + NODE}
