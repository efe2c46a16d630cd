"""Writes the daemon's health in the text exposition format of Prometheus, version 0.0.4.

    # HELP regolithd_sync_produced_total SYNC messages sent.
    # TYPE regolithd_sync_produced_total counter
    regolithd_sync_produced_total{rover="kapvik"} 1201

Names follow Prometheus's rules: base units (seconds, bytes), counters end in `_total`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from regolithd.daemon.messages.health import HealthMessage

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_MEGABYTE = 1e6


@dataclass(frozen=True, slots=True)
class DaemonState:
    """What is exposed: the rover's name, the health message, and whether broker, nodes and alarms are up or active."""

    rover: str
    health: HealthMessage
    connected: bool
    nodes: Mapping[int, bool]
    alarms: Mapping[str, bool]


@dataclass(frozen=True, slots=True)
class _Metric:
    name: str
    type: str
    help: str
    samples: Mapping[str, float]  # value by label value, "" where there is no further label
    label: str = ""


def exposition(state: DaemonState) -> str:
    """Return the text of all metrics."""
    return "".join(line for metric in _metrics(state) for line in _lines(metric, state.rover))


def _lines(metric: _Metric, rover: str) -> Iterator[str]:
    if not metric.samples:
        return
    yield f"# HELP {metric.name} {metric.help}\n# TYPE {metric.name} {metric.type}\n"
    for value_of_label, value in metric.samples.items():
        further = f',{metric.label}="{_escaped(value_of_label)}"' if metric.label else ""
        yield f'{metric.name}{{rover="{_escaped(rover)}"{further}}} {value!r}\n'


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _metrics(state: DaemonState) -> Iterator[_Metric]:
    health = state.health
    yield _gauge("process_resident_memory_bytes", "Resident memory.", health.memory_MB * _MEGABYTE)
    yield _counter("process_cpu_seconds_total", "Processor time.", health.cpu_s)
    yield _gauge("regolithd_uptime_seconds", "Time since the start.", health.uptime_s)
    yield _Metric(
        "regolithd_task_report_age_seconds", "gauge", "Time since a task last reported.", health.tasks, "task"
    )
    yield from _bus_metrics(health)
    yield from _publishing_metrics(state)
    if health.recording is not None:
        failing = health.recording.problem is not None
        yield _gauge("regolithd_recording_failing", "1 while the recording cannot be written.", float(failing))
        if health.recording.free_MB is not None:
            free = health.recording.free_MB * _MEGABYTE
            yield _gauge("regolithd_recording_free_bytes", "Free space of its disk.", free)
    nodes = {str(node_id): float(up) for node_id, up in state.nodes.items()}
    yield _Metric("regolithd_node_operational", "gauge", "1 while a node is operational.", nodes, "node_id")
    alarms = {name: float(active) for name, active in state.alarms.items()}
    yield _Metric("regolithd_alarm_active", "gauge", "1 while an alarm is active.", alarms, "alarm")


def _bus_metrics(health: HealthMessage) -> Iterator[_Metric]:
    yield _gauge("regolithd_bus_open", "1 while the CAN bus is open.", float(health.sync is not None))
    counts = {name: float(count) for name, count in health.bus.items()}
    yield _Metric("regolithd_bus_total", "counter", "Counts of the CAN socket, by kind.", counts, "kind")
    if health.sync is not None:
        syncs = {name: float(getattr(health.sync, name)) for name in ("produced", "skipped", "failed")}
        yield _Metric("regolithd_sync_total", "counter", "SYNC messages, by what became of them.", syncs, "result")
        late_s = health.sync.worst_late_ms / 1e3
        yield _gauge("regolithd_sync_worst_late_seconds", "Largest delay of a SYNC against its schedule.", late_s)
    if health.acquisition is not None:
        readings = {name: float(count) for name, count in health.acquisition.model_dump().items()}
        snapshots = readings.pop("snapshots")
        yield _counter("regolithd_snapshots_total", "Snapshots, one for each SYNC.", snapshots)
        yield _Metric("regolithd_readings_total", "counter", "PDOs, by what was done with them.", readings, "result")
    undecodable = {reason: float(count) for reason, count in health.undecodable.items()}
    help_text = "Frames that could not be decoded, by reason."
    yield _Metric("regolithd_undecodable_frames_total", "counter", help_text, undecodable, "reason")
    yield _counter("regolithd_events_withheld_total", "Events that were summarised.", health.events_withheld)


def _publishing_metrics(state: DaemonState) -> Iterator[_Metric]:
    report = state.health.publishing
    yield _gauge("regolithd_mqtt_connected", "1 while connected to the broker.", float(state.connected))
    yield _counter("regolithd_mqtt_connections_total", "Attempts to connect.", report.connections)
    yield _gauge(
        "regolithd_mqtt_queued_messages", "Stored messages that the broker has not acknowledged.", report.queued
    )
    yield _gauge("regolithd_mqtt_queued_bytes", "Their size on the disk.", report.queued_MB * _MEGABYTE)
    kinds = ("acknowledged", "repeated", "dropped", "unstored", "damaged")
    counts = {kind: float(getattr(report, kind)) for kind in kinds}
    yield _Metric(
        "regolithd_mqtt_messages_total", "counter", "Stored messages, by what became of them.", counts, "result"
    )


def _gauge(name: str, help_text: str, value: float) -> _Metric:
    return _Metric(name, "gauge", help_text, {"": float(value)})


def _counter(name: str, help_text: str, value: float) -> _Metric:
    return _Metric(name, "counter", help_text, {"": float(value)})
