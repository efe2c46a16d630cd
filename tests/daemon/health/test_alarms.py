"""Alarms follow from their inputs alone, and every alarm has a known name."""

import dataclasses

import pytest

from regolithd.daemon.health.alarms import AlarmInputs, alarm_names, current_alarms
from regolithd.daemon.messages.alarm import Severity
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.devices.ground_speed import GROUND_SPEED_SENSOR
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.master.intruders import Intruders, Service
from regolithd.drivers.master.status import NodePhase, NodeStatus

CELL = NodeDescription(13, LOAD_CELL, 2)
SPEED = NodeDescription(22, GROUND_SPEED_SENSOR, None, required=False)

TROUBLES = [
    ("bus_problem", "no such link", "bus", Severity.CRITICAL),
    ("bus_state", BusState.WARNING, "bus", Severity.WARNING),
    ("bus_state", BusState.PASSIVE, "bus", Severity.ERROR),
    ("bus_state", BusState.OFF, "bus", Severity.CRITICAL),
    ("bus_state", BusState.DOWN, "bus", Severity.CRITICAL),
    ("kernel_drops", 3, "kernel", Severity.ERROR),
    ("shared_node_ids", (3,), "node-id", Severity.ERROR),
    ("intruders", Intruders(services=(Service.SYNC,)), "master", Severity.ERROR),
    ("intruders", Intruders(nodes=(44,)), "unexpected-node", Severity.WARNING),
    ("store_problem", "no permission", "store", Severity.ERROR),
    ("store_dropped", 3, "store", Severity.ERROR),
    ("store_unstored", 3, "store", Severity.WARNING),
    ("store_damaged", 1, "store", Severity.ERROR),
    ("store_torn", 1, "store", Severity.WARNING),
    ("recording_problem", "no room", "recording", Severity.ERROR),
    ("recording_short", True, "recording", Severity.WARNING),
    ("control_problem", "no such group", "control", Severity.WARNING),
    ("wheel_problem", "wheel 3 (node 3) at 0.000", "wheel", Severity.ERROR),
    ("broker_problem", "connection refused", "broker", Severity.WARNING),
    ("model_problem", "no such file", "model", Severity.ERROR),
    ("undecodable", ("wrong-length of node 13",), "undecodable", Severity.WARNING),
    ("summarised", ("node-emergency of node 13",), "event-rate", Severity.WARNING),
    ("clock_jump_s", -3.0, "clock", Severity.WARNING),
]


def test_all_is_well() -> None:
    """Without a problem there is no alarm, and a node that boots is no problem yet."""
    nodes = {13: NodeStatus(CELL, NodePhase.BOOTING), 22: NodeStatus(SPEED, NodePhase.OPERATIONAL)}
    assert current_alarms(AlarmInputs(nodes=nodes)) == {}


@pytest.mark.parametrize(("fact", "value", "name", "severity"), TROUBLES)
def test_each_trouble_is_one_alarm_with_its_remedy(fact: str, value: object, name: str, severity: Severity) -> None:
    """Each problem gives one alarm, with severity, text and remedy, under a name from `alarm_names`."""
    inputs = AlarmInputs(recording_remedy="Free space.")
    alarms = current_alarms(dataclasses.replace(inputs, **{fact: value}))
    assert list(alarms) == [name]
    assert alarms[name].severity is severity
    assert alarms[name].text
    assert alarms[name].remedy
    assert name in alarm_names([])


@pytest.mark.parametrize("phase", [NodePhase.LOST, NodePhase.FAILED])
def test_a_node_that_is_missing_is_an_alarm_of_its_own(phase: NodePhase) -> None:
    """A required node gives an error, another one a warning."""
    nodes = {13: NodeStatus(CELL, phase, text="silent"), 22: NodeStatus(SPEED, phase)}
    alarms = current_alarms(AlarmInputs(nodes=nodes))
    assert {name: alarm.severity for name, alarm in alarms.items()} == {
        "node-13": Severity.ERROR,
        "node-22": Severity.WARNING,
    }
    assert alarms["node-13"].text == "silent"
    assert set(alarms) <= set(alarm_names(nodes))
