"""The master with slaves of another stack: python-canopen's LocalNodes, strict and odd ones."""

from __future__ import annotations

import asyncio
import itertools
import math
import re
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest
from described import load_cell, makers, motor
from rig import settings, until
from strangers import CURRENT, LOAD, Strangers

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.devices.eds.write import SHEETS, text
from regolithd.drivers.devices.load_cell import LOAD as LOAD_N
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED
from regolithd.drivers.devices.profiles.choice import DeviceChoice, Placement
from regolithd.drivers.devices.profiles.identity import identity_entries
from regolithd.drivers.errors import DriveError
from regolithd.drivers.master.events import MotionStopped, NodeBooted, NodeBootFailed, NodeEmergency, NodeLost
from regolithd.drivers.master.network import Network

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Sequence
    from pathlib import Path

    from regolithd.drivers.devices.decoding.signals import Signal
    from regolithd.drivers.devices.device import Quantity
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.master.events import NetworkEvent

CHANNELS = itertools.count()
SPEED = 60.0  # rad/s
TYPES = {402: 0x0002_0192, 404: 0x0002_0194, 401: 0x0004_0191}
RATED_mA = 2000


@dataclass
class Bench:
    """A network, and the strangers that it runs."""

    strangers: Strangers
    network: Network
    events: list[NetworkEvent] = field(default_factory=list)
    latest: dict[tuple[int, Quantity], float] = field(default_factory=dict)

    def take(self, signals: Sequence[Signal]) -> None:
        """Keep the newest values."""
        for signal in signals:
            if isinstance(signal, Reading):
                self.latest |= {(signal.node_id, quantity): value for quantity, value in signal.values}

    def events_of(self, kind: type, node_id: int) -> list[NetworkEvent]:
        """Return the events of one kind about a node."""
        return [event for event in self.events if isinstance(event, kind) and event.node_id == node_id]

    async def booted(self, *node_ids: int) -> None:
        """Wait until nodes are operational; fail with why one is not."""
        await until(
            lambda: all(self.events_of(NodeBooted, each) or self.events_of(NodeBootFailed, each) for each in node_ids),
            "every node is booted, or not",
        )
        failed = [str(event.text) for each in node_ids for event in self.events_of(NodeBootFailed, each)]
        assert not failed, failed

    async def drive(self, *node_ids: int) -> None:
        """Turn all wheels, and wait until these nodes have the speed."""
        await self.network.enable()
        await self.network.set_speed((SPEED,) * 6)
        for each in node_ids:
            await until(
                lambda each=each: abs(self.latest.get((each, MOTOR_SPEED), 0) - SPEED) < 0.2, f"speed of {each}"
            )


def identity(node: NodeDescription) -> dict[str, int]:
    """Return what the maker of a device programmed into it, where its EDS has no default."""
    known = {1: 0x9A, 2: 0x6150_0000, 3: 0} | identity_entries(node.device)
    device_type = known.pop(0)
    values = {f"o1018_{subindex}": value for subindex, value in known.items()}
    return values | {"o1000_0": TYPES.get(device_type, device_type), "o6075_0": RATED_mA}


@asynccontextmanager
async def bench(
    nodes: Sequence[NodeDescription], oddities: dict[int, tuple[str, ...]] | None = None, **changes: object
) -> AsyncIterator[Bench]:
    """Run strangers for these nodes, and a network; `changes` are network settings, or `sets` of the strangers."""
    channel = f"strangers-{next(CHANNELS)}"
    sets = changes.pop("sets", {})
    with Strangers("virtual", channel) as strangers:
        for node in nodes:
            kind = "motor" if node.device.commanded else "load"
            own = {} if node.device.eds.name in {"motor.eds", "load-cell.eds"} else identity(node)
            odd = (oddities or {}).get(node.node_id, ())
            strangers.add(node.node_id, str(node.device.eds), kind, *odd, **(own | sets))  # type: ignore[operator]
        async with open_bus("virtual", channel) as bus, asyncio.TaskGroup() as tasks:
            wanted = settings(nodes, gear_ratio=1.0, boot_up_timeout_s=3.0, **changes)  # type: ignore[arg-type]
            running = Bench(strangers, Network(bus, wanted))
            running.network._on_event = running.events.append
            running.network._on_signals = running.take
            task = tasks.create_task(running.network.run())
            try:
                yield running
            finally:
                task.cancel()
                await asyncio.wait([task])


DRIVES = {
    "epos24": (DeviceChoice("epos24"), CURRENT * 1e-3),
    "epos2": (DeviceChoice("epos2"), CURRENT * 1e-3),
    "epos4": (DeviceChoice("epos4"), CURRENT * 1e-3),
    "cia402": (DeviceChoice("cia402"), CURRENT * RATED_mA * 1e-6),
} | {name: (choice, CURRENT * 1e-3) for name, choice in makers().items()}


@pytest.mark.parametrize("name", DRIVES)
async def test_a_drive_of_another_stack_is_booted_and_driven(name: str) -> None:
    """Current and speed arrive in SI units, as the other stack was told to send them."""
    choice, current_A = DRIVES[name]
    async with bench([motor(choice, 1, 0)]) as b:
        await b.booted(1)
        await b.drive(1)
        assert b.latest[1, MOTOR_CURRENT] == pytest.approx(current_A)
        assert b.strangers.nodes[1].speed == pytest.approx(SPEED / _unit(b, 1), rel=0.01)
        await b.network.quick_stop()
        assert b.strangers.nodes[1].state == "disabled"


def _unit(b: Bench, node_id: int) -> float:
    """Return rad/s of one unit of the target velocity that was sent."""
    return SPEED / b.strangers.nodes[node_id].get(0x60FF, signed=True)


async def test_mixed_drives_and_cells_of_another_stack() -> None:
    """Four makes of drives and three kinds of load cells are on one bus; a fault of one stops the others."""
    nodes = [motor(choice, number, number - 1) for number, (choice, _) in enumerate(list(DRIVES.values())[:4], 1)]
    cells = {
        11: (DeviceChoice("newton"), LOAD * 0.01),
        12: (DeviceChoice("cia404"), LOAD * 0.1),
        13: (DeviceChoice("cia401", placements=(Placement("load_N", scale=0.0125),)), LOAD * 0.0125),
    }
    nodes += [load_cell(choice, number, number - 11) for number, (choice, _) in cells.items()]
    async with bench(nodes) as b:
        await b.booted(*(node.node_id for node in nodes))
        await b.drive(1, 2, 3, 4)
        for number, (_, load_N) in cells.items():
            assert b.latest[number, LOAD_N] == pytest.approx(load_N)
        b.strangers.nodes[2].fault()
        await until(lambda: b.events_of(MotionStopped, 2), "the fault stops the motion")
        assert b.events_of(NodeEmergency, 2)
        await until(lambda: all(b.strangers.nodes[each].speed == 0 for each in (1, 3, 4)), "the others stop")
        await b.drive(1, 2, 3, 4)  # enabling resets the fault


async def test_a_stranger_that_dies_is_lost_and_stops_the_others() -> None:
    """Its heartbeat ends: the node is lost, and the other drive stops."""
    nodes = [motor(DeviceChoice("epos4"), 1, 0), motor(DeviceChoice("cia402"), 2, 1)]
    async with bench(nodes) as b:
        await b.booted(1, 2)
        await b.drive(1, 2)
        b.strangers.nodes[2].die()
        await until(lambda: b.events_of(NodeLost, 2), "the node is lost")
        await until(lambda: b.strangers.nodes[1].speed == 0, "the other drive stops")


async def test_a_drive_stops_by_itself_when_the_master_falls_silent() -> None:
    """Its heartbeat consumer (0x1016) was configured: without the master's heartbeat it stops."""
    async with bench([motor(DeviceChoice("epos4"), 1, 0)], master_lost_after_s=0.3) as b:
        await b.booted(1)
        await b.drive(1)
        b.network.bus.send = _nothing  # type: ignore[method-assign]
        await until(lambda: b.strangers.nodes[1].lost_master and b.strangers.nodes[1].speed == 0, "it stops by itself")
        del b.network.bus.send


async def _nothing(_frame: object) -> None:
    """Send nothing."""


def variant(folder: Path, name: str, *changes: tuple[str, str]) -> DeviceChoice:
    """Return the choice of a profile with an EDS file that differs from the shipped one (regular expressions)."""
    sheet = next(each for each in SHEETS if each.name == name)
    content = text(sheet)
    for pattern, replacement in changes:
        content, count = re.subn(pattern, replacement, content)
        assert count, pattern
    path = folder / f"{name}-variant.eds"
    path.write_text(content)
    return DeviceChoice(name, path)


FIXED_COB_IDS = (
    r"(COB-ID used by .PDO \d\nObjectType=0x7\nDataType=0x0007\nAccessType=)rw\n(.*)\+0x80000",
    r"\1ro\n\2+0x40000",
)
NO_CONSUMER = (r"(?s)\[1016\].*?\n\n(?=\[1017)", "")
NO_QUICK_STOP = (r"(?s)\[605A\].*?\n\n", "")


async def test_read_only_cob_ids_are_compared_and_not_written(tmp_path: Path) -> None:
    """PDOs at fixed identifiers, enabled and not to be disabled: mapped as they are, and driven."""
    async with bench([motor(variant(tmp_path, "cia402", FIXED_COB_IDS), 1, 0)]) as b:
        await b.booted(1)
        await b.drive(1)


async def test_a_drive_without_heartbeat_consumer_is_booted_with_a_reservation(tmp_path: Path) -> None:
    """0x1016 and 0x605A are optional; that the drive will not stop by itself is said."""
    async with bench([motor(variant(tmp_path, "cia402", NO_CONSUMER, NO_QUICK_STOP), 1, 0)]) as b:
        await b.booted(1)
        said = b.events_of(NodeBooted, 1)[0].text
        assert "it has no 0x1016 and does not stop by itself when the daemon ends" in said
        assert "not checked: vendor (it has 0x0000009A), product (it has 0x61500000)" in said


async def test_an_emcy_identifier_in_use_is_switched_off_before_it_is_changed() -> None:
    """0x1014 of a valid, other identifier is changed in two steps, as CiA 301 wants."""
    async with bench([motor(DeviceChoice("cia402"), 1, 0)], {1: ("elsewhere",)}) as b:
        await b.booted(1)
        assert b.strangers.nodes[1].get(0x1014) == 0x081


async def test_a_block_upload_in_answer_is_aborted_and_the_object_read_in_segments() -> None:
    """A server that offers a block upload where a segmented one was asked for is read all the same."""
    async with bench([motor(DeviceChoice("epos4"), 1, 0)], {1: ("blocks",)}) as b:
        await b.booted(1)
        name = await b.network._drives[1].remote.sdo.read(0x1008)
        assert name == b"a name of more than seven bytes"
        assert b.strangers.nodes[1].node.sdo.offered == 1
        await b.drive(1)


async def test_a_late_boot_up_is_awaited_for_the_configured_time() -> None:
    """A device that takes 1.5 s to boot is booted with 3 s, and named with less."""
    async with bench([motor(DeviceChoice("epos4"), 1, 0)], {1: ("late",)}) as b:
        await b.booted(1)


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        ({"o6075_0": 0}, "0x6075:00 = 0x0: the rated current is 0"),
        ({"o60A9_0": 0x00B54700}, "0x60A9:00 = 0xB54700: no angle per time"),
        ({"o1000_0": 0x0002_0194}, "its device type is 0x00000194, expected 0x00000192"),
    ],
)
async def test_what_a_stranger_states_wrongly_is_refused(sets: dict[str, int], said: str) -> None:
    """A unit that is not set, or another kind of device, is a failed boot that names object and value."""
    async with bench([motor(DeviceChoice("cia402"), 1, 0)], sets=sets) as b:
        await until(lambda: b.events_of(NodeBootFailed, 1), "the boot fails")
        assert said in b.events_of(NodeBootFailed, 1)[0].text


async def test_the_decoder_learns_units_from_the_frames_alone() -> None:
    """A second decoder that is fed the frames, as a replay is, gives the same values."""
    node = motor(DeviceChoice("cia402"), 1, 0)
    other, seen = Decoder([node]), {}

    def read(batch: Sequence[object]) -> None:
        for frame in batch:
            signal = other.decode(frame)  # type: ignore[arg-type]
            if isinstance(signal, Reading):
                seen.update(signal.values)

    async with bench([node]) as b:
        b.network._on_frames = read
        await b.booted(1)
        await b.drive(1)
        assert seen[MOTOR_CURRENT] == pytest.approx(CURRENT * RATED_mA * 1e-6)
        assert math.isclose(seen[MOTOR_SPEED], SPEED, rel_tol=0.01)
        assert {frame.data[1:4] for frame in other.unit_frames} == {b"\x75\x60\x00", b"\xa9\x60\x00"}


async def test_an_unbooted_drive_cannot_be_commanded_in_an_unknown_unit() -> None:
    """Without its unit there is no target velocity: an error, not a wrong speed."""
    async with bench([motor(DeviceChoice("epos4"), 1, 0)]) as b:
        await b.booted(1)
        await b.network.enable()
        b.network._drives[1].remote.stated.clear()
        with pytest.raises(DriveError, match="the objects of its unit"):
            await b.network.set_speed((SPEED,) * 6)
