"""The MQTT sink of the service: publishes estimates and events as they come, health and alarms once a second.

Events and alarms are logged as well, here alone.
"""

from __future__ import annotations

import asyncio
import re
import resource
import shutil
import time
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from regolithd.daemon.health.alarm_log import AlarmLog
from regolithd.daemon.health.alarms import NO_INTRUDERS, Alarm, AlarmInputs, alarm_names, current_alarms
from regolithd.daemon.health.event_throttle import EventThrottle
from regolithd.daemon.health.prometheus import DaemonState, exposition
from regolithd.daemon.health.rising_counts import RisingCounts
from regolithd.daemon.health.stuck_sensor import StuckSensorDetector
from regolithd.daemon.messages.alarm import AlarmMessage, Severity
from regolithd.daemon.messages.bus import EmergencyMessage, EventMessage, IdentityReport, NodeMessage
from regolithd.daemon.messages.header import iso_time, time_fields
from regolithd.daemon.messages.health import AcquisitionReport, HealthMessage, RecordingReport, SyncReport
from regolithd.daemon.messages.odometry import OdometryMessage
from regolithd.daemon.messages.posterior import PosteriorMessage
from regolithd.daemon.pipeline.dead_reckoning import DeadReckoning
from regolithd.daemon.pipeline.soil_change import soil_change_text
from regolithd.daemon.publish.publisher import STABLE_CONNECTION_S
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.canopen.emcy import register_bits
from regolithd.drivers.devices.decoding.decoder import Undecodable
from regolithd.drivers.master.events import NodeEmergency
from regolithd.drivers.master.status import NodePhase

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.pipeline.snapshot import Estimate, SoilChange
    from regolithd.daemon.publish.publisher import Publisher
    from regolithd.daemon.service import Service
    from regolithd.drivers.master.events import NetworkEvent
    from regolithd.drivers.master.network import Network
    from regolithd.drivers.master.status import NodeStatus

HEALTH_PERIOD_S = 1.0
CLOCK_JUMP_NS = 500_000_000
"""A change of CLOCK_REALTIME against CLOCK_MONOTONIC by more than this within a second: the clock was set."""
CLOCK_JUMP_ALARM_S = 60.0
SOIL_CHANGE_ALARM_S = 120.0
BROKER_ALARM_S = 10.0
"""A broker that has not been reached for this long is an alarm: shorter losses happen on a radio link."""
PUBLISHING = "publishing"
PUBLISHING_TIMEOUT_S = 10.0
_PAGE_MB = resource.getpagesize() / 1e6


class MqttSink:
    """Publishes everything that the service produces, over MQTT.

    Parameters
    ----------
    service
        The service whose estimates, events and state are published.
    publisher
        The publisher that delivers the messages.
    control_problem
        Returns why no commands can be taken, or an empty text.
    wheel_problem
        Returns which wheels have not done what the last traverse commanded, or an empty text.
    monotonic_ns
        The clock by which events are throttled and alarms end.
    """

    def __init__(
        self,
        service: Service,
        publisher: Publisher,
        *,
        control_problem: Callable[[], str] = lambda: "",
        wheel_problem: Callable[[], str] = lambda: "",
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.publisher = publisher
        self._service = service
        self._control_problem = control_problem
        self._wheel_problem = wheel_problem
        self._monotonic_ns = monotonic_ns
        self._started_ns = monotonic_ns()
        self._published_nodes: dict[int, NodeStatus] = {}
        self._published_alarms: dict[str, Alarm | None] = {}
        self._since: dict[str, str] = {}
        self._offset_ns = time.time_ns() - monotonic_ns()
        self._jump_s = 0.0
        self._jump_until_ns = 0
        self._soil_change: SoilChange | None = None
        self._dead_reckoning = DeadReckoning(service.configuration)
        self._last_alarms: dict[str, Alarm] = {}
        self._soil_change_until_ns = 0
        self._stuck_sensors = StuckSensorDetector()
        self._undecodable = RisingCounts()
        self._connected_ns = self._stable_ns = self._started_ns
        self._throttle = EventThrottle()
        self._log = AlarmLog(monotonic_ns)
        self._changes_scheduled = False

    def estimate(self, estimate: Estimate) -> None:
        """Publish the estimate of one SYNC, with its posterior and soil-change event if it has any."""
        self._stuck_sensors.step(estimate.snapshot)
        self.publisher.estimate(estimate)
        publish, time_ns = self.publisher.publish, estimate.snapshot.time_ns
        if estimate.soil_change is not None:
            self._soil_change = estimate.soil_change
            self._soil_change_until_ns = self._monotonic_ns() + int(SOIL_CHANGE_ALARM_S * 1e9)
            text = soil_change_text(estimate.soil_change)
            publish("event", EventMessage, time_ns=time_ns, kind="soil-change", node_id=None, text=text)
        if estimate.posterior is not None:
            publish("posterior", PosteriorMessage, time_ns=time_ns, **asdict(estimate.posterior))
        if (pose := self._dead_reckoning.step(estimate)) is not None:
            publish("odometry", OdometryMessage, time_ns=time_ns, **asdict(pose))

    def event(self, event: NetworkEvent) -> None:
        """Publish an event, and then, once the network has updated its state, the nodes and alarms that changed.

        Events that come too often are summarised once a second, with the nodes and alarms that they change.
        """
        if not self._throttle.admits(event, self._monotonic_ns()):
            return
        self._publish_event(event, 0)
        if not self._changes_scheduled:
            self._changes_scheduled = True
            asyncio.get_running_loop().call_soon(self._publish_changes)

    def _publish_event(self, event: NetworkEvent, suppressed: int) -> None:
        self._log.event(event, suppressed)
        publish = self.publisher.publish
        publish("event", EventMessage, time_ns=event.time_ns, **event_fields(event), suppressed=suppressed)
        if isinstance(event, NodeEmergency):
            fields = self._emergency_fields(event)
            publish("emcy", EmergencyMessage, time_ns=event.time_ns, **fields, suppressed=suppressed)

    def _publish_summaries(self) -> None:
        for event, withheld in self._throttle.summaries():
            self._publish_event(event, withheld - 1)

    async def run(self) -> None:
        """Deliver until cancelled, and publish health and alarms once a second."""
        self._service.liveness.expect(PUBLISHING, PUBLISHING_TIMEOUT_S)
        async with asyncio.TaskGroup() as tasks:
            reporting = tasks.create_task(self._report_periodically())
            try:
                await self.publisher.run()
            finally:
                reporting.cancel()
                self._publish_summaries()

    async def _report_periodically(self) -> None:
        while True:
            self._detect_clock_jump()
            self._note_lasting_problems()
            self._publish_summaries()
            self._publish_changes()
            self.publisher.publish("health", HealthMessage, **self._health())
            await asyncio.sleep(HEALTH_PERIOD_S)

    def _publish_changes(self) -> None:
        """Publish each node and each alarm that differs from what was last published."""
        self._changes_scheduled = False
        network = self._service.network
        for node_id, status in (network.status if network is not None else {}).items():
            state = replace(status, heard_ns=None)  # the time of each heartbeat is no news
            if self._published_nodes.get(node_id) != state:
                self._published_nodes[node_id] = state
                self.publisher.publish(f"node/{node_id}", NodeMessage, **node_fields(status))
        active = current_alarms(self._alarm_inputs())
        for name in alarm_names(node.node_id for node in self._service.configuration.described()):
            alarm = active.get(name)
            if name not in self._published_alarms or self._published_alarms[name] != alarm:
                self._publish_alarm(name, alarm)

    def _publish_alarm(self, name: str, alarm: Alarm | None) -> None:
        """Publish an alarm, or that it is not active: the broker may have retained an active one of an earlier run.

        The message of an alarm's end keeps its last text and evidence.
        """
        if alarm is not None:
            self._last_alarms[name] = alarm
        now = time.time_ns()
        if name not in self._since or (alarm is None) != (self._published_alarms.get(name) is None):
            self._since[name] = iso_time(now)
        self._published_alarms[name] = alarm
        self._log.alarm(name, alarm)
        fields = asdict(self._last_alarms.get(name) or Alarm(name, Severity.WARNING, "", ""))
        fields |= {"active": alarm is not None, "since": self._since[name]}
        self.publisher.publish(f"alarm/{name}", AlarmMessage, time_ns=now, **fields)

    def _detect_clock_jump(self) -> None:
        now = self._monotonic_ns()
        offset = time.time_ns() - now
        if abs(offset - self._offset_ns) > CLOCK_JUMP_NS:
            self._jump_s = (offset - self._offset_ns) / 1e9
            self._jump_until_ns = now + int(CLOCK_JUMP_ALARM_S * 1e9)
        elif now > self._jump_until_ns:
            self._jump_s = 0.0
        self._offset_ns = offset

    def _note_lasting_problems(self) -> None:
        """Note what is a problem only when it lasts: frames that cannot be decoded, a broker that is away."""
        network, now = self._service.network, self._monotonic_ns()
        if network is not None:
            self._undecodable.step(_undecodable(network), now)
        if not self.publisher.problem:
            self._connected_ns = now
        if not self.publisher.recent_problem:
            self._stable_ns = now

    def _broker_problem(self) -> str:
        now, limit_ns = self._monotonic_ns(), BROKER_ALARM_S * 1e9
        if now - self._connected_ns > limit_ns:
            return self.publisher.problem
        unstable = now - self._stable_ns > limit_ns + STABLE_CONNECTION_S * 1e9
        return self.publisher.recent_problem if unstable else ""

    def _alarm_inputs(self) -> AlarmInputs:
        service = self._service
        network, recorder, report = service.network, service.recorder, self.publisher.report
        return AlarmInputs(
            nodes=network.status if network is not None else {},
            bus_problem=service.bus_problem,
            bus_state=network.bus.state if network is not None else BusState.ACTIVE,
            kernel_drops=network.bus.counters.kernel_drops if network is not None else 0,
            shared_node_ids=service.chain.acquisition.shared_node_ids,
            intruders=network.intruders.present(time.time_ns()) if network is not None else NO_INTRUDERS,
            store_problem=self.publisher.store_problem,
            store_dropped=report.dropped,
            store_unstored=report.unstored,
            store_damaged=report.damaged,
            store_torn=report.torn,
            recording_problem=(recorder.problem or "") if recorder is not None else "",
            recording_remedy=recorder.remedy if recorder is not None else "",
            recording_short=recorder is not None and recorder.deletes_early,
            control_problem=self._control_problem(),
            wheel_problem=self._wheel_problem(),
            broker_problem=self._broker_problem(),
            model_problem=service.models.problem,
            undecodable=self._undecodable.lasting(self._monotonic_ns()),
            clock_jump_s=self._jump_s,
            soil_change=self._soil_change if self._monotonic_ns() < self._soil_change_until_ns else None,
            stuck=self._stuck_sensors.stuck,
            summarised=tuple(_kind_and_node(*key) for key in self._throttle.summarised(self._monotonic_ns())),
        )

    def _health(self) -> dict[str, Any]:
        service = self._service
        network = service.network
        return {
            "uptime_s": (self._monotonic_ns() - self._started_ns) / 1e9,
            "cpu_s": time.process_time(),
            "memory_MB": _resident_MB(),
            "bus_state": service.bus_problem or (network.bus.state.value if network is not None else None),
            "bus": network.bus.counters.as_dict() if network is not None else {},
            "sync": _sync_report(service),
            "acquisition": AcquisitionReport(**asdict(service.chain.acquisition.counters)),
            "undecodable": {} if network is None else dict(network.decoder.undecodable),
            "events_withheld": self._throttle.withheld,
            "publishing": self.publisher.report,
            "recording": _recording_report(service),
            "tasks": service.liveness.ages_s(),
        }

    def metrics(self) -> str:
        """Return what `health` has, and the state of broker, nodes and alarms, as metrics of Prometheus."""
        service, network = self._service, self._service.network
        header = {"session": self.publisher.session, "sequence": 0, **time_fields(time.time_ns())}
        nodes = network.status if network is not None else {}
        return exposition(
            DaemonState(
                rover=service.configuration.rover.name,
                health=HealthMessage.model_validate(header | self._health()),
                connected=self.publisher.connected,
                nodes={number: status.phase is NodePhase.OPERATIONAL for number, status in nodes.items()},
                alarms={name: alarm is not None for name, alarm in self._published_alarms.items()},
            )
        )

    def _emergency_fields(self, event: NodeEmergency) -> dict[str, Any]:
        nodes = {node.node_id: node for node in self._service.configuration.described()}
        node = nodes.get(event.node_id)
        emergency = event.emergency
        return {
            "node_id": event.node_id,
            "kind": node.kind if node else None,
            "wheel": node.wheel + 1 if node and node.wheel is not None else None,
            "code": f"0x{emergency.code:04X}",
            "register_bits": register_bits(emergency.register),
            "vendor_bytes": emergency.vendor.hex(),
            "cleared": emergency.cleared,
            "text": emergency.text,
        }


def _undecodable(network: Network) -> dict[str, int]:
    """Return the counts of frames that should have been decoded, by reason and node.

    Those with an unknown identifier are left out: nodes that nobody expects have an alarm of their own, and other
    services (time stamp, LSS) are no error.
    """
    decoder = network.decoder
    of_nodes = {f"{reason} of node {node_id}": count for (reason, node_id), count in decoder.malformed.items()}
    foreign = {reason: decoder.undecodable[reason] for reason in (Undecodable.EXTENDED, Undecodable.REMOTE)}
    return of_nodes | {str(reason): count for reason, count in foreign.items() if count}


def event_fields(event: NetworkEvent) -> dict[str, Any]:
    """Return the fields of an `event` message."""
    return {"kind": _kind(type(event)), "node_id": getattr(event, "node_id", None) or None, "text": event.text}


def _kind(event: type[NetworkEvent]) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", event.__name__).lower()


def _kind_and_node(event: type[NetworkEvent], node_id: int | None) -> str:
    return f"{_kind(event)} of node {node_id}" if node_id else _kind(event)


def node_fields(status: NodeStatus) -> dict[str, Any]:
    """Return the fields of a `node/…` message."""
    node = status.node
    identity = status.identity
    return {
        "node_id": node.node_id,
        "kind": node.kind,
        "wheel": None if node.wheel is None else node.wheel + 1,
        "required": node.required,
        "phase": status.phase,
        "nmt_state": None if status.nmt_state is None else status.nmt_state.text,
        "drive_state": None if status.drive_state is None else status.drive_state.value,
        "heard": None if status.heard_ns is None else iso_time(status.heard_ns),
        "identity": None if identity is None else IdentityReport(**asdict(identity)),
        "reason": None if status.reason is None else status.reason.value,
        "text": status.text,
        "boots": status.boots,
        "emergencies": status.emergencies,
    }


def _sync_report(service: Service) -> SyncReport | None:
    if service.network is None:
        return None
    sync = service.network.counters.sync
    return SyncReport(
        produced=sync.produced,
        skipped=sync.skipped,
        failed=sync.failed,
        worst_late_ms=sync.worst_late_ns / 1e6,
        mean_late_ms=sync.mean_late_ns / 1e6,
    )


def _recording_report(service: Service) -> RecordingReport | None:
    recorder = service.recorder
    if recorder is None:
        return None
    paths = recorder.paths
    try:
        free = shutil.disk_usage(service.configuration.recording.directory).free / 1e6
    except OSError:
        free = None
    return RecordingReport(file=str(paths[0]) if paths else None, free_MB=free, problem=recorder.problem)


def _resident_MB() -> float:
    try:
        with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123  # once a second: pathlib costs more
            return int(file.read().split()[1]) * _PAGE_MB
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
