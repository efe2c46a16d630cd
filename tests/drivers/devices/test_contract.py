"""One contract that every registered device passes against its virtual node."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rig import rig, until

from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.decoding.pdo import tpdos
from regolithd.drivers.devices.ground_speed import GROUND_SPEED, GROUND_SPEED_SENSOR
from regolithd.drivers.devices.inclinometer import INCLINOMETER, PITCH, ROLL, YAW_RATE
from regolithd.drivers.devices.load_cell import LOAD, LOAD_CELL
from regolithd.drivers.devices.motor_controller import (
    BUS_VOLTAGE,
    MOTOR_CONTROLLER,
    MOTOR_CURRENT,
    MOTOR_SPEED,
    MOTOR_TEMPERATURE,
    STATUSWORD,
)
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.master.boot_configuration import boot_writes
from regolithd.drivers.master.events import NodeBooted, NodeEmergency, NodeLost
from regolithd.drivers.virtual.plant import Measurement

NODES = {
    MOTOR_CONTROLLER: NodeDescription(3, MOTOR_CONTROLLER, 2, diagnostics=True),
    LOAD_CELL: NodeDescription(14, LOAD_CELL, 3),
    INCLINOMETER: NodeDescription(21, INCLINOMETER, None),
    GROUND_SPEED_SENSOR: NodeDescription(22, GROUND_SPEED_SENSOR, None),
}


class World:
    """A plant with different values for all sensors, negative ones among them."""

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return constant values."""
        del time_s, motor_speed_rad_s
        return Measurement(
            motor_current_A=np.array([0.01, 0.02, -0.081, 0.04, 0.05, 0.06]),
            load_N=np.array([10.0, 20.0, 30.0, 44.56, 50.0, 60.0]),
            motor_temperature_degC=np.array([1.0, 2.0, -3.5, 4.0, 5.0, 6.0]),
            bus_voltage_V=23.456,
            pitch_rad=math.radians(-12.34),
            roll_rad=math.radians(5.67),
            yaw_rate_rad_s=math.radians(-0.89),
            ground_speed_m_s=-0.02199,
        )


EXPECTED = {
    MOTOR_CONTROLLER: {
        MOTOR_CURRENT: -0.081,
        MOTOR_SPEED: 0.0,
        BUS_VOLTAGE: 23.456,
        MOTOR_TEMPERATURE: -3.5,
    },
    LOAD_CELL: {LOAD: 44.56},
    INCLINOMETER: {
        PITCH: math.radians(-12.34),
        ROLL: math.radians(5.67),
        YAW_RATE: math.radians(-0.89),
    },
    GROUND_SPEED_SENSOR: {GROUND_SPEED: -0.02199},
}


@pytest.fixture(params=DEVICES, ids=lambda device: device.kind)
def node(request: pytest.FixtureRequest) -> NodeDescription:
    """One node of each kind."""
    return NODES[request.param]


async def test_it_boots_reports_its_identity_and_sends_heartbeats(node: NodeDescription) -> None:
    """The node becomes operational with the identity of its EDS, and its heartbeat continues."""
    async with rig([node]) as r:
        booted = await r.wait_for_event(NodeBooted)
        assert booted.identity.vendor in (0xFB, 0xFFFF00)
        heard = r.network.status[node.node_id].heard_ns
        await until(lambda: r.network.status[node.node_id].heard_ns > heard, "the next heartbeat")
        assert r.network.status[node.node_id].nmt_state is NmtState.OPERATIONAL


async def test_its_configuration_is_in_the_node(node: NodeDescription) -> None:
    """Every object that was written during boot holds the written value."""
    async with rig([node]) as r:
        await r.wait_for_event(NodeBooted)
        sdo = r.network._supervisors[node.node_id].remote.sdo
        wanted = {}
        for write in boot_writes(node, heartbeat_s=0.2, master_id=127, master_lost_after_s=2.0):
            wanted[write.index, write.subindex] = write  # the last one counts
        for write in wanted.values():
            value = await sdo.read_number(write.index, write.subindex, signed=write.signed)
            assert value & write.mask == write.value, hex(write.index)


async def test_its_measurements_arrive_in_si_units(node: NodeDescription) -> None:
    """Every quantity of the layout arrives with sign and scale, and no other."""
    async with rig([node], plant=World()) as r:
        await r.wait_for_event(NodeBooted)
        pdos = tpdos(node.device, diagnostics=node.diagnostics)
        await until(lambda: len(r.readings(node.node_id)) >= 3 * len(pdos), "three readings of each PDO")
        last = r.readings(node.node_id)[-len(pdos) :]
        assert {reading.cob_id for reading in last} == {pdo.cob_id(node.node_id) for pdo in pdos}
        measured = {quantity: value for reading in last for quantity, value in reading.values}
        measured.pop(STATUSWORD, None)
        assert measured == pytest.approx(EXPECTED[node.device], abs=1e-9)


async def test_its_emergency_is_reported_with_a_text(node: NodeDescription) -> None:
    """An emergency and its end are events."""
    async with rig([node]) as r:
        await r.wait_for_event(NodeBooted)
        r.rover.inject_fault(f"emcy {node.node_id} 0x4210")
        told = await r.wait_for_event(NodeEmergency)
        assert "temperature" in told.text
        r.rover.inject_fault(f"emcy {node.node_id} 0")
        assert (await r.wait_for_event(NodeEmergency)).emergency.cleared


async def test_it_is_lost_and_returns(node: NodeDescription) -> None:
    """A node that loses power is lost, and boots again after power-on."""
    async with rig([node]) as r:
        await r.wait_for_event(NodeBooted)
        r.rover.inject_fault(f"off {node.node_id}")
        await r.wait_for_event(NodeLost)
        r.rover.inject_fault(f"on {node.node_id}")
        await r.wait_for_event(NodeBooted)


async def test_short_frames_are_counted_and_not_decoded(node: NodeDescription) -> None:
    """A PDO that is shorter than its mapping gives no value."""
    async with rig([node]) as r:
        await r.wait_for_event(NodeBooted)
        r.rover.inject_fault(f"short {node.node_id} 1")
        await until(lambda: r.decoder.undecodable["wrong-length"] > 3, "wrong lengths counted")


async def test_an_invalid_measurement_has_no_value() -> None:
    """A load cell that reports `not valid` in 0x6150 gives a reading without value."""
    async with rig([NODES[LOAD_CELL]]) as r:
        await r.wait_for_event(NodeBooted)
        r.rover.inject_fault("status 14 1")
        await until(lambda: r.readings(14) and r.readings(14)[-1].values == (), "a reading without value")
