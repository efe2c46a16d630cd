"""Decides which alarms are active: a pure function of `AlarmInputs`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from regolithd.daemon.messages.alarm import Severity, SoilChangeEvidence
from regolithd.daemon.messages.alarm_guide import ALARM_GUIDE, NODE
from regolithd.daemon.messages.header import iso_time
from regolithd.daemon.pipeline.soil_change import soil_change_text, wheels_of
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.master.intruders import Intruders, Service
from regolithd.drivers.master.status import NodePhase

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from regolithd.daemon.pipeline.snapshot import SoilChange
    from regolithd.drivers.devices.device import Quantity
    from regolithd.drivers.master.status import NodeStatus

NO_INTRUDERS = Intruders()
_ELSEWHERE = {NODE, "mismatch"}
"""Entries of the guide: nodes have one alarm each, and the comparison has its own."""
_BUS_SEVERITY = {
    BusState.WARNING: Severity.WARNING,
    BusState.PASSIVE: Severity.ERROR,
    BusState.OFF: Severity.CRITICAL,
    BusState.DOWN: Severity.CRITICAL,
}


@dataclass(frozen=True, slots=True)
class Alarm:
    """A condition that needs attention; `name` is also its topic, `alarm/<name>`."""

    name: str
    severity: Severity
    text: str
    remedy: str
    latching: bool = False
    evidence: SoilChangeEvidence | None = None


@dataclass(frozen=True, slots=True)
class AlarmInputs:
    """The values that alarms are decided from. An empty text means no problem; counts are since the start."""

    nodes: Mapping[int, NodeStatus] = field(default_factory=dict)
    bus_problem: str = ""
    bus_state: BusState = BusState.ACTIVE
    kernel_drops: int = 0
    shared_node_ids: tuple[int, ...] = ()
    intruders: Intruders = NO_INTRUDERS
    store_problem: str = ""
    store_dropped: int = 0
    store_unstored: int = 0
    store_damaged: int = 0
    store_torn: int = 0
    recording_problem: str = ""
    recording_remedy: str = ""
    recording_short: bool = False
    control_problem: str = ""
    wheel_problem: str = ""
    broker_problem: str = ""
    model_problem: str = ""
    undecodable: tuple[str, ...] = ()
    clock_jump_s: float = 0.0
    soil_change: SoilChange | None = None
    stuck: tuple[tuple[Quantity, int], ...] = ()
    summarised: tuple[str, ...] = ()


def current_alarms(inputs: AlarmInputs) -> dict[str, Alarm]:
    """Return the active alarms by name."""
    found = [
        *_node_alarms(inputs.nodes.values()),
        *_bus_alarms(inputs),
        *_intruder_alarms(inputs),
        *_undecodable_alarms(inputs),
        *_wheel_alarms(inputs),
        *_daemon_alarms(inputs),
    ]
    return {alarm.name: alarm for alarm in found}


def alarm_names(node_ids: Iterable[int]) -> tuple[str, ...]:
    """Return the name of every alarm that is decided here."""
    return (*(name for name in ALARM_GUIDE if name not in _ELSEWHERE), *(f"{NODE}-{number}" for number in node_ids))


def _node_alarms(nodes: Iterable[NodeStatus]) -> Iterable[Alarm]:
    for status in nodes:
        if status.phase not in {NodePhase.LOST, NodePhase.FAILED}:
            continue
        severity = Severity.ERROR if status.node.required else Severity.WARNING
        what = status.text or f"node {status.node.node_id} is {status.phase.value}"
        remedy = "Check its power and its connection. It is booted again as soon as its heartbeat returns."
        yield Alarm(f"node-{status.node.node_id}", severity, what, remedy)


def _bus_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.bus_problem:
        yield Alarm("bus", Severity.CRITICAL, inputs.bus_problem, "`regolithd check` gives details.")
    elif severity := _BUS_SEVERITY.get(inputs.bus_state):
        remedy = (
            "Check cable, termination (120 Ω at both ends) and bit rate; `ip -details link` shows the error counters."
        )
        yield Alarm("bus", severity, f"the bus is in state {inputs.bus_state.value}", remedy)
    if inputs.kernel_drops:
        remedy = "Lower [sync] rate_Hz, or stop other programs on this computer."
        yield Alarm("kernel", Severity.ERROR, f"the kernel dropped {inputs.kernel_drops} frames in this run", remedy)


def _undecodable_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.undecodable:
        text = f"frames keep coming that cannot be decoded: {', '.join(inputs.undecodable)}"
        remedy = "Compare the node's PDO mapping with [devices] (`regolithd check`); `candump -e` shows the frames."
        yield Alarm("undecodable", Severity.WARNING, text, remedy)


def _intruder_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.shared_node_ids:
        which = ", ".join(map(str, inputs.shared_node_ids))
        text = f"two nodes answer with node-ID {which}; their values are not published"
        remedy = "Switch one off, and give it a node-ID of its own (DIP switches, LSS, or the maker's program)."
        yield Alarm("node-id", Severity.ERROR, text, remedy)
    if inputs.intruders.services:
        what = " and ".join(inputs.intruders.services)
        samples = Service.SYNC in inputs.intruders.services
        text = f"another master on the bus {what}{'; values are not published meanwhile' if samples else ''}"
        remedy = "End it, or switch off SYNC there (bit 30 of its 0x1005): one bus has one master."
        yield Alarm("master", Severity.ERROR, text, remedy)
    if inputs.intruders.nodes:
        which = ", ".join(map(str, inputs.intruders.nodes))
        remedy = "`regolithd scan` says what it is. Add it to [nodes], or take it off the bus."
        yield Alarm(
            "unexpected-node", Severity.WARNING, f"on the bus, but not in the configuration: node {which}", remedy
        )


def _daemon_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    yield from _store_alarms(inputs)
    yield from _recording_alarms(inputs)
    if inputs.broker_problem:
        remedy = "Messages are stored meanwhile, and sent, marked late, once there is a connection."
        yield Alarm("broker", Severity.WARNING, inputs.broker_problem, remedy)
    if inputs.model_problem:
        remedy = "Measurements are published without estimates until the daemon is restarted with a model that fits."
        yield Alarm("model", Severity.ERROR, inputs.model_problem, remedy)
    if inputs.control_problem:
        yield Alarm(
            "control",
            Severity.WARNING,
            inputs.control_problem,
            "The rover cannot be commanded until this is corrected.",
        )
    if inputs.stuck:
        which = ", ".join(f"{quantity.name} of wheel {wheel}" for quantity, wheel in inputs.stuck)
        text = f"{which}: the reading has been exactly constant for seconds, while other wheels' readings change"
        remedy = "Do not use it: switch the node off and on, check its connector, replace it."
        yield Alarm("sensor", Severity.ERROR, text, remedy)
    if inputs.soil_change is not None:
        yield _soil_change(inputs.soil_change)
    if inputs.summarised:
        text = f"{', '.join(inputs.summarised)}: they come too often, and are summarised once a second (`suppressed`)"
        remedy = "Look at what the node reports (`emcy`, `event`), and correct it, or switch the node off."
        yield Alarm("event-rate", Severity.WARNING, text, remedy)
    if inputs.clock_jump_s:
        text = f"the clock jumped by {inputs.clock_jump_s:+.3f} s: times before and after are not comparable"
        remedy = "Synchronise it before the daemon starts (time-sync.target)."
        yield Alarm("clock", Severity.WARNING, text, remedy, latching=True)


def _recording_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.recording_problem:
        yield Alarm("recording", Severity.ERROR, inputs.recording_problem, inputs.recording_remedy)
    elif inputs.recording_short:
        text = "the disk has less room than [recording] limit_MB: the oldest recordings are deleted earlier"
        remedy = "Copy recordings elsewhere and free space on the disk, or lower [recording] limit_MB."
        yield Alarm("recording", Severity.WARNING, text, remedy)


def _wheel_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.wheel_problem:
        remedy = (
            "Look at these wheels before the next traverse, which ends this alarm: blocked, or a gear or drive failed."
        )
        yield Alarm("wheel", Severity.ERROR, inputs.wheel_problem, remedy)


def _soil_change(changed: SoilChange) -> Alarm:
    alarm, fall = changed.alarm, changed.fall
    evidence = SoilChangeEvidence(
        onset=iso_time(alarm.onset_ns),
        direction="fall" if alarm.direction == "fall" else "rise",
        wheels=wheels_of(alarm.group),
        torque_ratio=alarm.torque_ratio,
        statistic=alarm.statistic,
        threshold=alarm.threshold,
        cohesion_fell=fall and fall.cohesion,
        friction_angle_fell=fall and fall.friction_angle,
        drawbar_margin_fell=fall and fall.drawbar_margin,
    )
    remedy = "Stop before the wheels dig in, and look: drive with less slip, another way, or back."
    return Alarm("soil-change", Severity.WARNING, soil_change_text(changed), remedy, latching=True, evidence=evidence)


def _store_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    """Yield one alarm at most: the worst of what happened to the store of messages."""
    if inputs.store_problem:
        remedy = "Until the daemon is restarted with a store, messages are in memory only, the newest 512."
        yield Alarm("store", Severity.ERROR, inputs.store_problem, remedy)
    elif inputs.store_damaged:
        text = f"{inputs.store_damaged} stored messages were damaged on the disk; {inputs.store_dropped} are lost"
        yield Alarm("store", Severity.ERROR, text, "Check the disk of [mqtt] spool_directory; replace an old SD card.")
    elif inputs.store_dropped:
        text = f"{inputs.store_dropped} messages were lost: the store was full, or could not be read"
        yield Alarm(
            "store", Severity.ERROR, text, "Restore the connection to the broker, or raise [mqtt] spool_limit_MB."
        )
    elif inputs.store_unstored:
        text = f"the disk refused {inputs.store_unstored} messages; they are kept in memory only"
        yield Alarm("store", Severity.WARNING, text, "Free space on the disk of [mqtt] spool_directory.")
    elif inputs.store_torn:
        text = "the last message that was being stored when the daemon or the power failed is incomplete"
        yield Alarm("store", Severity.WARNING, text, "None needed: at most that message is lost.")
