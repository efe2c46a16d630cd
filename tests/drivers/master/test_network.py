"""The network on a bus in this process: supervision, commands, and the state after its end."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from rig import rig, until

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.decoding.signals import Sync
from regolithd.drivers.devices.load_cell import LOAD, LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER, MOTOR_SPEED
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import DriveError
from regolithd.drivers.master.cia402 import DriveState
from regolithd.drivers.master.events import (
    DriveStateChanged,
    MotionStopped,
    NodeBooted,
    NodeBootFailed,
    NodeEmergency,
    NodeLost,
    NodeReturned,
)
from regolithd.drivers.master.scan import scan

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Quantity

MOTORS = tuple(NodeDescription(1 + wheel, MOTOR_CONTROLLER, wheel) for wheel in range(6))
LOAD_CELLS = tuple(NodeDescription(11 + wheel, LOAD_CELL, wheel) for wheel in range(6))
CREEP_rad_s = (0.29,) * 6


def values(readings: list, quantity: Quantity) -> list[float]:
    """Return the values of one quantity."""
    return [value for reading in readings for name, value in reading.values if name is quantity]


async def test_every_node_boots_and_measures() -> None:
    """All fourteen nodes become operational and answer each SYNC."""
    async with rig() as r:
        await r.network.settled()
        assert {status.phase for status in r.network.status.values()} == {"operational"}
        assert {status.nmt_state for status in r.network.status.values()} == {NmtState.OPERATIONAL}
        await until(lambda: all(len(r.readings(node.node_id)) > 3 for node in r.decoder.nodes), "three readings of all")
        assert values(r.readings(13), LOAD)[-1] == pytest.approx(52.0)
        assert any(isinstance(signal, Sync) for signal in r.signals)
        assert not r.decoder.undecodable
        assert r.network.counters.sdo_failures == 0


async def test_wheels_turn_at_the_commanded_speed_and_stop() -> None:
    """The measured motor speeds follow enable, speed, quick stop and disable."""
    async with rig(MOTORS) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed((0.1, 0.2, 0.3, -0.1, -0.2, 0.0))
        for node_id, speed in enumerate((140.0, 280.0, 420.0, -140.0, -280.0, 0.0), start=1):
            await until(
                lambda node_id=node_id, speed=speed: (
                    values(r.readings(node_id), MOTOR_SPEED)[-1] == pytest.approx(speed, abs=0.06)
                ),
                f"motor {node_id} turning at {speed} rad/s",
            )
        await r.network.quick_stop()
        await until(
            lambda: all(values(r.readings(node), MOTOR_SPEED)[-1] == 0.0 for node in range(1, 7)),
            "all wheels standing",
        )
        with pytest.raises(DriveError, match="a quick stop was commanded"):
            await r.network.set_speed(CREEP_rad_s)
        await r.network.disable()
        assert not any(r.events_of(MotionStopped))


async def test_mirrored_motors_turn_the_other_way_and_read_as_forward() -> None:
    """For driving forward the mirrored motors turn backwards, and their speed is read as forward."""
    known = [replace(motor, mirrored=motor.node_id % 2 == 0) for motor in MOTORS]
    async with rig(MOTORS, known=known) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed((0.1,) * 6)
        for node_id in range(1, 7):
            await until(
                lambda node_id=node_id: values(r.readings(node_id), MOTOR_SPEED)[-1] == pytest.approx(140.0, abs=0.06),
                f"motor {node_id} reads as forward",
            )
        assert r.rover.nodes[1].device.speed_rad_s > 0.0
        assert r.rover.nodes[2].device.speed_rad_s < 0.0


async def test_a_speed_is_refused_before_enabling() -> None:
    """No frame is sent."""
    async with rig(MOTORS) as r:
        await r.network.settled()
        await until(lambda: len(r.frames), "frames")
        with pytest.raises(DriveError, match=r"the wheels are locked: they have not been enabled yet\. Enable them"):
            await r.network.set_speed(CREEP_rad_s)
        assert not [frame for frame in r.frames if frame.can_id & 0x780 == 0x200]


async def test_a_stop_cancels_enabling() -> None:
    """Enabling that is under way fails and leaves no drive enabled."""
    async with rig(MOTORS) as r:
        await r.network.settled()
        enabling = asyncio.ensure_future(r.network.enable())
        await r.until_transfers(1, r.network._supervisors[1].remote.sdo.transfers + 2)
        await r.network.quick_stop()
        with pytest.raises(DriveError, match="stopped meanwhile: a quick stop was commanded"):
            await enabling
        await until(
            lambda: {r.network.status[node].drive_state for node in range(1, 7)} == {DriveState.SWITCH_ON_DISABLED},
            "all drives switched off",
        )
        with pytest.raises(DriveError, match="locked"):
            await r.network.set_speed(CREEP_rad_s)


async def test_a_truncated_statusword_is_ignored() -> None:
    """A TPDO that is too short does not change the state of the drive."""
    async with rig(MOTORS) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)
        r.rover.inject_fault("short 2 7")
        await until(lambda: r.decoder.undecodable["wrong-length"] > 3, "short frames")
        assert r.network.status[2].drive_state is DriveState.ENABLED
        assert not r.events_of(MotionStopped)


async def test_a_missing_drive_cannot_be_enabled_and_the_message_says_why() -> None:
    """The message has the node-ID and the reason of the failed boot."""
    async with rig(MOTORS[:5], known=MOTORS) as r:
        await r.network.settled()
        with pytest.raises(DriveError, match=r"node 6: the drive is not operational .*no boot-up message"):
            await r.network.enable()


async def test_a_lost_drive_stops_the_others_and_returns_without_a_restart() -> None:
    """A drive that loses power while driving stops all others, and after power-on it is booted and drives again."""
    async with rig(MOTORS) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)
        r.rover.inject_fault("off 3")
        lost = await r.wait_for_event(NodeLost, node_id=3)
        assert "no heartbeat" in lost.text
        stopped = await r.wait_for_event(MotionStopped, node_id=3)
        assert "all others are stopped" in stopped.text
        await until(
            lambda: all(
                r.network.status[node].drive_state is DriveState.SWITCH_ON_DISABLED for node in (1, 2, 4, 5, 6)
            ),
            "the others switched off",
        )
        r.rover.inject_fault("on 3")
        await r.wait_for_event(NodeReturned, node_id=3)
        await until(lambda: r.network.status[3].boots == 2, "node 3 booted a second time")
        assert not r.events_of(NodeReturned)  # told once
        assert [r.network.status[node].boots for node in range(1, 7)] == [1, 1, 2, 1, 1, 1]
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)


async def test_a_lost_load_cell_that_is_not_required_does_not_stop_the_wheels() -> None:
    """Losing a node that is not required does not stop the motion."""
    optional = NodeDescription(11, LOAD_CELL, 0, required=False)
    async with rig((*MOTORS, optional)) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)
        r.rover.inject_fault("off 11")
        await r.wait_for_event(NodeLost, node_id=11)
        await r.network.set_speed(CREEP_rad_s)
        assert not r.events_of(MotionStopped)


async def test_a_drive_that_faults_stops_the_others_and_is_reset_by_enabling() -> None:
    """Emergency and state are events, and enabling resets the fault with a rising edge."""
    async with rig(MOTORS) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)
        r.rover.inject_fault("fault 2 0x2310")
        emergency = (await r.wait_for_event(NodeEmergency, node_id=2)).emergency
        assert (emergency.code, emergency.cleared) == (0x2310, False)
        assert "overcurrent" in emergency.text
        await r.wait_for_event(MotionStopped, node_id=2)
        await until(lambda: r.network.status[2].drive_state is DriveState.FAULT, "drive 2 in fault")
        await r.network.enable()
        assert r.network.status[2].drive_state is DriveState.ENABLED
        assert r.network.status[2].emergencies >= 1


async def test_a_node_that_leaves_operational_or_restarts_is_booted_again() -> None:
    """Both are reported as a loss, and the node becomes operational again."""
    async with rig([LOAD_CELLS[0]]) as r:
        await r.wait_for_event(NodeBooted)
        r.rover.inject_fault("leave 11")
        assert "pre-operational" in (await r.wait_for_event(NodeLost)).text
        await r.wait_for_event(NodeBooted)
        r.rover.inject_fault("reset 11")
        assert "restarted" in (await r.wait_for_event(NodeLost)).text
        await r.wait_for_event(NodeBooted)


async def test_a_wrong_node_does_not_affect_the_others() -> None:
    """With one wrong identity, eleven other nodes measure."""
    async with rig((*MOTORS, *LOAD_CELLS), faults=["identity 4 vendor 0x1"]) as r:
        await r.network.settled()
        assert r.events_of(NodeBootFailed)[0].node_id == 4
        assert [node for node, status in r.network.status.items() if status.phase != "operational"] == [4]
        await until(lambda: len(r.readings(5)) > 2, "node 5 measures")


async def test_stopping_disables_drives_and_nodes() -> None:
    """Cancelled while driving, the network stops and disables the drives and sets every node to pre-operational."""
    async with rig((*MOTORS, LOAD_CELLS[0])) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)
        await until(lambda: r.events_of(DriveStateChanged, node_id=1, state=DriveState.ENABLED), "driving")
        await r.stop()
        await until(
            lambda: all(node.state == NmtState.PRE_OPERATIONAL for node in r.rover.nodes.values()), "pre-operational"
        )
        for node_id in range(1, 7):
            assert r.rover.nodes[node_id].device.speed_rad_s == 0.0
        await asyncio.sleep(2.5)  # longer than the heartbeat consumer time of the drives
        assert not r.events_of(NodeEmergency)
        assert sum(node.counts["emcy"] for node in r.rover.nodes.values()) == 0


async def test_a_drive_stops_by_itself_when_its_master_hangs() -> None:
    """Without the master's heartbeat the drive's own consumer (0x1016) stops it."""
    async with rig([MOTORS[0]]) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed(CREEP_rad_s)
        motor = r.rover.nodes[1].device
        await until(lambda: motor.speed_rad_s > 0.0, "the motor turning")
        r.bus.send = forget  # type: ignore[method-assign]  # what a hung program sends
        await until(lambda: motor.speed_rad_s == 0.0, "the motor standing")


async def forget(_frame: object) -> None:
    """Send nothing, without an error."""


async def test_a_scan_reads_identities_and_changes_nothing() -> None:
    """Identities and problems are returned, and neither an NMT command nor an SDO download is on the bus."""
    nodes = (*MOTORS[:3], LOAD_CELLS[0])
    async with rig(nodes, faults=["identity 2 product 0x999", "off 3"]) as r:
        await r.network.settled()
        await r.stop()
        async with open_bus("virtual", r.bus.channel) as witness:
            found = {each.node.node_id: each for each in await scan(r.bus, nodes, listen_s=0.1)}
            await asyncio.sleep(0.2)
            seen = await witness.receive()
        requests = [frame for frame in seen if frame.can_id & 0x780 == 0x600]
        assert requests
        assert {frame.data[0] for frame in requests} <= {0x40, 0x80}  # reads, and the abort of one without answer
        assert not [frame for frame in seen if frame.can_id < 0x80]
        assert found[1].problem == ""
        assert found[1].identity.vendor == 0xFB
        assert "product code" in found[2].problem
        assert found[2].remedy
        assert not found[3].answers
        assert found[3].remedy
        assert found[11].answers
