"""The fields of health, node, event and EMCY messages, from a service whose parts the test makes."""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.health.liveness import TaskLiveness
from regolithd.daemon.messages.header import iso_time, time_fields
from regolithd.daemon.messages.health import PublishingReport
from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.daemon.publish import mqtt_sink
from regolithd.daemon.publish.mqtt_sink import MqttSink, event_fields, node_fields
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.can.counters import BusCounters
from regolithd.drivers.canopen.emcy import Emergency
from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.decoding.decoder import Decoder, Undecodable
from regolithd.drivers.devices.ground_speed import GROUND_SPEED_SENSOR
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.master.boot_error import BootReason
from regolithd.drivers.master.cia402 import DriveState
from regolithd.drivers.master.events import BusStateChanged, Identity, NodeBootFailed, NodeEmergency, NodeLost
from regolithd.drivers.master.intruders import IntruderWatch
from regolithd.drivers.master.status import NetworkCounters, NodePhase, NodeStatus

T_NS = 1_700_000_000_000_000_000
MOTOR = NodeDescription(3, MOTOR_CONTROLLER, 2)
REPORT = PublishingReport(
    connections=0, queued=0, queued_MB=0.0, acknowledged=0, repeated=0, dropped=0, unstored=0, damaged=0, torn=0
)


@dataclass
class Publisher:
    """A publisher that keeps topic and fields of each message."""

    report: PublishingReport = REPORT
    store_problem: str = ""
    session: str = "20261122T000000Z-aaaa"
    connected: bool = False
    problem: str = ""
    recent_problem: str = ""
    published: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def publish(self, topic: str, message: type, *, time_ns: int = T_NS, **fields: Any) -> None:
        """Keep a message that its model accepts."""
        message.model_validate({"session": "s", "sequence": 0, **time_fields(time_ns), **fields})
        self.published.append((topic, fields))


class Clock:
    """A monotonic clock that the test sets [s]."""

    now_s = 100.0

    def __call__(self) -> int:
        """Return the time [ns]."""
        return round(self.now_s * 1e9)


@pytest.fixture
def clock() -> Clock:
    """Return a clock at 100 s."""
    return Clock()


@pytest.fixture
def service(clock: Clock, tmp_path: Path) -> Any:
    """Return a service with a network and a recorder."""
    configuration = Configuration.model_validate({"recording": {"directory": tmp_path}})
    counters = NetworkCounters()
    counters.sync.produced, counters.sync.skipped, counters.sync.failed = 10, 2, 1
    counters.sync.worst_late_ns, counters.sync.mean_late_ns = 1_500_000, 250_000.0
    bus = SimpleNamespace(state=BusState.PASSIVE, counters=BusCounters(kernel_drops=4))
    network = SimpleNamespace(
        bus=bus,
        counters=counters,
        status={},
        intruders=IntruderWatch((), master_id=127),
        decoder=SimpleNamespace(undecodable=Counter({"wrong-length": 3}), malformed={("wrong-length", 3): 3}),
    )
    return SimpleNamespace(
        configuration=configuration,
        network=network,
        recorder=SimpleNamespace(
            paths=(tmp_path / "a.mcap", tmp_path / "a.log"), problem=None, remedy="", deletes_early=True
        ),
        bus_problem="",
        models=SimpleNamespace(problem=""),
        chain=SimpleNamespace(acquisition=Acquisition((), (), 1)),
        liveness=TaskLiveness(clock),
    )


def test_a_node_is_described_for_people() -> None:
    """Wheels count from 1; what is not known is null; states have their names."""
    fresh = node_fields(NodeStatus(NodeDescription(22, GROUND_SPEED_SENSOR, None, required=False)))
    assert fresh == {
        "node_id": 22,
        "kind": "ground-speed",
        "wheel": None,
        "required": False,
        "phase": "booting",
        "nmt_state": None,
        "drive_state": None,
        "heard": None,
        "identity": None,
        "reason": None,
        "text": "",
        "boots": 0,
        "emergencies": 0,
    }
    status = NodeStatus(
        MOTOR,
        NodePhase.FAILED,
        nmt_state=NmtState.PRE_OPERATIONAL,
        heard_ns=T_NS,
        identity=Identity(1, 2, 3, 4, 5),
        reason=BootReason.NO_HEARTBEAT,
        text="why",
        drive_state=DriveState.FAULT,
        boots=3,
        emergencies=7,
    )
    found = node_fields(status)
    assert (found["wheel"], found["nmt_state"], found["drive_state"]) == (3, "pre-operational", "fault")
    assert (found["heard"], found["reason"], found["phase"]) == (iso_time(T_NS), "no-heartbeat", "failed")
    assert (found["boots"], found["emergencies"], found["required"], found["text"]) == (3, 7, True, "why")
    assert found["identity"].serial == 5


def test_an_event_has_a_kind_and_its_node() -> None:
    """The kind is the event's name with hyphens; an event of the bus has no node."""
    failed = NodeBootFailed(T_NS, 3, BootReason.NO_HEARTBEAT, "it failed", "remedy")
    assert event_fields(failed) == {"kind": "node-boot-failed", "node_id": 3, "text": "it failed"}
    changed = BusStateChanged(T_NS, BusState.OFF, "bus off")
    assert event_fields(changed) == {"kind": "bus-state-changed", "node_id": None, "text": "bus off"}


@pytest.mark.parametrize(("node_id", "kind", "wheel"), [(3, "motor", 3), (11, "load-cell", 1), (99, None, None)])
async def test_an_emergency_is_told_with_its_node(
    service: Any, clock: Clock, node_id: int, kind: str | None, wheel: int | None
) -> None:
    """Code and vendor bytes in hexadecimal digits, the names of the register's bits; a node that is not known, too."""
    publisher = Publisher()
    sink = MqttSink(service, publisher, monotonic_ns=clock)  # type: ignore[arg-type]
    emergency = Emergency(T_NS, node_id, 0x813, 0x11, b"\1\2\3\4\xff", "heartbeat lost")
    sink.event(NodeEmergency(T_NS, node_id, emergency, "text"))
    (first, event), (second, found) = publisher.published[:2]
    assert (first, event["kind"], event["suppressed"]) == ("event", "node-emergency", 0)
    assert second == "emcy"
    assert (found["node_id"], found["kind"], found["wheel"]) == (node_id, kind, wheel)
    assert (found["code"], found["vendor_bytes"], found["cleared"]) == ("0x0813", "01020304ff", False)
    assert found["register_bits"] == ("generic", "communication")
    await asyncio.sleep(0)  # the changes follow once the network has updated its state
    assert any(topic.startswith("alarm/") for topic, _ in publisher.published)


def test_health_has_the_counters_of_every_part(service: Any, clock: Clock) -> None:
    """Times in s and ms, memory in MB; without a bus or a recorder their parts are null."""
    sink = MqttSink(service, Publisher(), monotonic_ns=clock)  # type: ignore[arg-type]
    service.liveness.expect("reader", 5.0)
    clock.now_s += 12.5
    found = sink._health()
    assert found["uptime_s"] == 12.5
    assert found["tasks"] == {"reader": 12.5}
    assert found["bus_state"] == "passive"
    assert found["bus"]["kernel_drops"] == 4
    sync = found["sync"]
    assert (sync.produced, sync.skipped, sync.failed) == (10, 2, 1)
    assert (sync.worst_late_ms, sync.mean_late_ms) == (1.5, 0.25)
    assert found["recording"].file.endswith("a.mcap")
    assert found["recording"].free_MB > 1.0
    assert found["recording"].problem is None
    assert found["undecodable"] == {"wrong-length": 3}
    assert 5.0 < found["memory_MB"] < 100_000.0
    service.network = service.recorder = None
    empty = sink._health()
    assert (empty["bus_state"], empty["bus"], empty["sync"], empty["recording"]) == (None, {}, None, None)
    service.bus_problem = "no such device"
    assert sink._health()["bus_state"] == "no such device"


def test_a_recording_without_a_file_or_a_disk_is_reported(service: Any, clock: Clock) -> None:
    """Its problem is told."""
    service.recorder = SimpleNamespace(paths=None, problem="no room")
    service.configuration = Configuration.model_validate({"recording": {"directory": Path("/nowhere")}})
    found = MqttSink(service, Publisher(), monotonic_ns=clock)._health()["recording"]  # type: ignore[arg-type]
    assert (found.file, found.free_MB, found.problem) == (None, None, "no room")


def test_alarm_inputs_come_from_every_part(service: Any, clock: Clock) -> None:
    """Also from the publisher's report and from the control socket."""
    report = REPORT.model_copy(update={"dropped": 1, "unstored": 2, "damaged": 3, "torn": 4})
    service.recorder.problem, service.recorder.remedy = "no room", "free some"
    sink = MqttSink(
        service,
        Publisher(report),  # type: ignore[arg-type]
        control_problem=lambda: "no group",
        wheel_problem=lambda: "wheel 3",
        monotonic_ns=clock,
    )
    found = sink._alarm_inputs()
    assert (found.store_dropped, found.store_unstored, found.store_damaged, found.store_torn) == (1, 2, 3, 4)
    assert (found.bus_state, found.kernel_drops, found.bus_problem) == (BusState.PASSIVE, 4, "")
    assert (found.recording_problem, found.recording_remedy, found.recording_short) == ("no room", "free some", True)
    assert (found.control_problem, found.wheel_problem) == ("no group", "wheel 3")
    service.network = service.recorder = None
    empty = sink._alarm_inputs()
    assert (empty.bus_state, empty.kernel_drops, empty.recording_problem, empty.nodes) == (BusState.ACTIVE, 0, "", {})
    assert (empty.recording_remedy, empty.recording_short) == ("", False)


async def test_frames_that_cannot_be_decoded_are_an_alarm_when_they_last(service: Any, clock: Clock) -> None:
    """After ten seconds the alarm names reason and node; it ends when no more come; foreign identifiers are none."""
    sink = MqttSink(service, Publisher(), monotonic_ns=clock)  # type: ignore[arg-type]
    decoder = service.network.decoder = Decoder(())
    for second in range(20):
        clock.now_s += 1.0
        decoder.undecodable[Undecodable.UNKNOWN_COB_ID] += 1
        decoder.malformed[Undecodable.WRONG_LENGTH, 13] += second <= 12
        sink._note_lasting_problems()
        expected = ("wrong-length of node 13",) if 10 <= second <= 17 else ()
        assert sink._alarm_inputs().undecodable == expected, second


async def test_a_broker_that_stays_away_is_an_alarm(service: Any, clock: Clock) -> None:
    """The reason is told after ten seconds, until there is a connection again."""
    publisher = Publisher(problem="the password file is not UTF-8", recent_problem="the password file is not UTF-8")
    sink = MqttSink(service, publisher, monotonic_ns=clock)  # type: ignore[arg-type]
    clock.now_s += 9.0
    sink._note_lasting_problems()
    assert sink._alarm_inputs().broker_problem == ""
    clock.now_s += 2.0
    assert sink._alarm_inputs().broker_problem == "the password file is not UTF-8"
    publisher.problem = ""
    sink._note_lasting_problems()
    publisher.problem = "no answer"
    assert sink._alarm_inputs().broker_problem == ""


async def test_a_broker_that_is_lost_again_and_again_is_an_alarm(service: Any, clock: Clock) -> None:
    """The reason is told after fifteen seconds, while connected as well, until a connection has lasted."""
    publisher = Publisher()
    sink = MqttSink(service, publisher, monotonic_ns=clock)  # type: ignore[arg-type]
    publisher.recent_problem = "taken over"
    for second in range(1, 20):
        clock.now_s += 1.0
        publisher.problem = "taken over" if second % 2 else ""
        sink._note_lasting_problems()
        assert sink._alarm_inputs().broker_problem == ("taken over" if second > 15 else ""), second
    publisher.problem = publisher.recent_problem = ""
    sink._note_lasting_problems()
    publisher.recent_problem = "taken over"
    assert sink._alarm_inputs().broker_problem == ""


@pytest.mark.parametrize(("jump_s", "noticed"), [(0.4, False), (0.6, True), (-0.6, True)])
def test_a_clock_that_was_set_is_an_alarm_for_a_minute(
    service: Any, clock: Clock, monkeypatch: pytest.MonkeyPatch, jump_s: float, noticed: bool
) -> None:
    """A change of more than half a second within a second; the alarm has its size."""
    wall = [1_000.0]
    monkeypatch.setattr(mqtt_sink.time, "time_ns", lambda: round(wall[0] * 1e9))
    sink = MqttSink(service, Publisher(), monotonic_ns=clock)  # type: ignore[arg-type]
    wall[0] += jump_s
    sink._detect_clock_jump()
    assert sink._jump_s == (pytest.approx(jump_s) if noticed else 0.0)
    for seconds, there in ((59.0, noticed), (2.0, False)):
        clock.now_s += seconds
        wall[0] += seconds
        sink._detect_clock_jump()
        assert bool(sink._jump_s) == there


def test_a_node_is_published_when_more_than_its_heartbeat_changed(service: Any, clock: Clock) -> None:
    """The time at which it was heard changes all the time, and alone is no news."""
    publisher = Publisher()
    sink = MqttSink(service, publisher, monotonic_ns=clock)  # type: ignore[arg-type]
    service.network.bus.state = BusState.ACTIVE
    for heard_ns, phase in ((1, NodePhase.BOOTING), (2, NodePhase.BOOTING), (3, NodePhase.OPERATIONAL)):
        service.network.status = {3: NodeStatus(MOTOR, phase, heard_ns=T_NS + heard_ns)}
        sink._publish_changes()
    published = [fields["phase"] for topic, fields in publisher.published if topic == "node/3"]
    assert published == ["booting", "operational"]


async def test_lost_nodes_are_events(service: Any, clock: Clock) -> None:
    """With the time of the event."""
    publisher = Publisher()
    MqttSink(service, publisher, monotonic_ns=clock).event(NodeLost(T_NS, 3, "lost"))  # type: ignore[arg-type]
    assert publisher.published[0] == ("event", {"kind": "node-lost", "node_id": 3, "text": "lost", "suppressed": 0})


def test_tasks_are_overdue_after_their_own_time() -> None:
    """Exactly the timeout is in time; a report starts it anew."""
    clock = Clock()
    liveness = TaskLiveness(clock)
    liveness.expect("quick", 1.0)
    liveness.expect("slow", 10.0)
    clock.now_s += 1.0
    assert liveness.overdue() == []
    clock.now_s += 0.5
    assert liveness.overdue() == ["quick"]
    assert liveness.ages_s() == {"quick": 1.5, "slow": 1.5}
    liveness.beat("quick")
    assert liveness.overdue() == []
    assert liveness.ages_s() == {"quick": 0.0, "slow": 1.5}


def test_the_metrics_have_health_nodes_and_alarms(service: Any, clock: Clock) -> None:
    """Here of a node that has not booted, without a broker, and of the SYNC."""
    service.network.status = {3: NodeStatus(MOTOR)}
    told = MqttSink(service, Publisher(), monotonic_ns=clock).metrics().splitlines()  # type: ignore[arg-type]
    for name, value in (
        ('regolithd_sync_total{rover="kapvik",result="skipped"}', 2.0),
        ('regolithd_mqtt_connected{rover="kapvik"}', 0.0),
        ('regolithd_node_operational{rover="kapvik",node_id="3"}', 0.0),
    ):
        assert f"{name} {value}" in told
