"""What is wrong at this moment, told from the inputs alone: the same inputs, the same alarms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from regolithd.daemon.messages.alarm import Severity
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.master.status import NodePhase

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from regolithd.drivers.devices.device import Quantity
    from regolithd.drivers.master.status import NodeStatus

_BUS_SEVERITY = {
    BusState.WARNING: Severity.WARNING,
    BusState.PASSIVE: Severity.ERROR,
    BusState.OFF: Severity.CRITICAL,
    BusState.DOWN: Severity.CRITICAL,
}


@dataclass(frozen=True, slots=True)
class Alarm:
    """Something that is wrong; `name` is what it is about, and its topic."""

    name: str
    severity: Severity
    text: str
    cure: str


@dataclass(frozen=True, slots=True)
class AlarmInputs:
    """What alarms are told from. Empty texts mean that all is well; counts are since the start."""

    nodes: Mapping[int, NodeStatus] = field(default_factory=dict)
    bus_trouble: str = ""
    bus_state: BusState = BusState.ACTIVE
    kernel_drops: int = 0
    store_dropped: int = 0
    store_unstored: int = 0
    recording_trouble: str = ""
    control_trouble: str = ""
    clock_jump_s: float = 0.0
    soil_change: str = ""
    stuck: tuple[tuple[Quantity, int], ...] = ()


def current_alarms(inputs: AlarmInputs) -> dict[str, Alarm]:
    """Return what is wrong, by name."""
    found = [*_node_alarms(inputs.nodes.values()), *_bus_alarms(inputs), *_own_alarms(inputs)]
    return {alarm.name: alarm for alarm in found}


def known_names(node_ids: Iterable[int]) -> tuple[str, ...]:
    """Return every name that an alarm can have."""
    return (
        "bus",
        "kernel",
        "store",
        "recording",
        "control",
        "clock",
        "sensor",
        "soil-change",
        *(f"node-{number}" for number in node_ids),
    )


def _node_alarms(nodes: Iterable[NodeStatus]) -> Iterable[Alarm]:
    for status in nodes:
        if status.phase not in {NodePhase.LOST, NodePhase.FAILED}:
            continue
        severity = Severity.ERROR if status.node.required else Severity.WARNING
        what = status.text or f"node {status.node.node_id} is {status.phase.value}"
        cure = "Is it powered and connected? It is booted again as soon as it is heard."
        yield Alarm(f"node-{status.node.node_id}", severity, what, cure)


def _bus_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.bus_trouble:
        yield Alarm("bus", Severity.CRITICAL, inputs.bus_trouble, "`regolithd check` says more.")
    elif severity := _BUS_SEVERITY.get(inputs.bus_state):
        cure = "Look at cable, termination (120 Ω at both ends) and bit rate; `ip -details link` shows the counters."
        yield Alarm("bus", severity, f"the bus is in state {inputs.bus_state.value}", cure)
    if inputs.kernel_drops:
        cure = "The computer is too busy, or the bus too full: lower [sync] rate_Hz, or stop what else runs."
        yield Alarm("kernel", Severity.ERROR, f"the kernel dropped {inputs.kernel_drops} frames in this run", cure)


def _own_alarms(inputs: AlarmInputs) -> Iterable[Alarm]:
    if inputs.store_dropped:
        text = f"{inputs.store_dropped} messages were lost: the store was full, or could not be read"
        yield Alarm("store", Severity.ERROR, text, "Bring the broker back, or raise [mqtt] spool_limit_MB.")
    elif inputs.store_unstored:
        text = f"the disk refused {inputs.store_unstored} messages; they waited in memory alone"
        yield Alarm("store", Severity.WARNING, text, "Make room on the disk of [mqtt] spool_directory.")
    if inputs.recording_trouble:
        yield Alarm("recording", Severity.ERROR, inputs.recording_trouble, "Make room, or mend [recording] directory.")
    if inputs.control_trouble:
        yield Alarm("control", Severity.WARNING, inputs.control_trouble, "Until then the rover cannot be commanded.")
    if inputs.stuck:
        which = ", ".join(f"{quantity.name} of wheel {wheel}" for quantity, wheel in inputs.stuck)
        text = f"{which}: the same to the last digit for seconds, while other wheels' readings change"
        cure = "Do not trust it: switch the node off and on, look at its plug, exchange it."
        yield Alarm("sensor", Severity.ERROR, text, cure)
    if inputs.soil_change:
        cure = "Stop and look before the wheels dig in: less slip, another way, or back."
        yield Alarm("soil-change", Severity.WARNING, inputs.soil_change, cure)
    if inputs.clock_jump_s:
        text = f"the clock jumped by {inputs.clock_jump_s:+.3f} s: times before and after do not fit together"
        yield Alarm(
            "clock", Severity.WARNING, text, "Let it be synchronised before the daemon starts (time-sync.target)."
        )
