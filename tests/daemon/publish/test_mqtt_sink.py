"""Which messages the MQTT sink publishes, with a publisher that only records them."""

import asyncio
import json
import socket
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count, islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from broker import Mosquitto
from estimates import estimate
from subscriber import until

from regolithd.calibration.posterior.change_detection import Alarm as Change
from regolithd.calibration.posterior.estimator import FallProbability
from regolithd.daemon.config.configuration import Configuration, Mqtt
from regolithd.daemon.health.alarms import alarm_names
from regolithd.daemon.messages.header import iso_time, time_fields
from regolithd.daemon.messages.health import PublishingReport
from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.daemon.pipeline.snapshot import SoilChange
from regolithd.daemon.publish.connection import OTHERS_WINDOW, WINDOW, Connection
from regolithd.daemon.publish.mqtt_sink import MqttSink
from regolithd.daemon.publish.outbox import Outbox
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.spool import Spool
from regolithd.daemon.publish.stores import Stores
from regolithd.drivers.canopen.emcy import Emergency
from regolithd.drivers.master.events import NodeEmergency

NO_MESSAGES = PublishingReport(
    connections=0, queued=0, queued_MB=0.0, acknowledged=0, repeated=0, dropped=0, unstored=0, damaged=0, torn=0
)


NO_PROBLEM = SimpleNamespace(problem="")  # of the models


@dataclass
class Recorder:
    """A publisher that keeps topic and fields of each message."""

    report: PublishingReport = NO_MESSAGES
    store_problem: str = ""
    problem: str = ""
    recent_problem: str = ""
    published: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def publish(self, topic: str, message: type, *, time_ns: int, **fields: Any) -> None:
        """Keep a message that its model accepts."""
        message.model_validate({"session": "s", "sequence": 0, **time_fields(time_ns), **fields})
        self.published.append((topic, fields))

    def taken(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the messages since the last call."""
        taken, self.published = self.published, []
        return taken


@pytest.fixture
def service() -> Any:
    """A service whose bus is not open yet, without problems."""
    chain = SimpleNamespace(acquisition=Acquisition((), (), 1))
    return SimpleNamespace(
        configuration=Configuration(), network=None, recorder=None, bus_problem="", chain=chain, models=NO_PROBLEM
    )


def test_at_the_start_every_alarm_is_published_once_as_not_active(service: Any) -> None:
    """The broker may have retained an active one of an earlier run."""
    publisher = Recorder()
    sink = MqttSink(service, publisher)  # type: ignore[arg-type]
    sink._publish_changes()
    names = alarm_names(node.node_id for node in service.configuration.described())
    published = publisher.taken()
    assert [topic for topic, _ in published] == [f"alarm/{name}" for name in names]
    assert not any(fields["active"] for _, fields in published)
    sink._publish_changes()
    assert publisher.taken() == []


def test_an_alarm_is_published_when_it_begins_changes_and_ends_and_not_between(service: Any) -> None:
    """It is retained, so a repetition tells a subscriber nothing."""
    publisher = Recorder()
    sink = MqttSink(service, publisher)  # type: ignore[arg-type]
    sink._publish_changes()
    publisher.taken()
    for problem in ("no such device", "no such device", "permission denied", "", ""):
        service.bus_problem = problem
        sink._publish_changes()
    taken = publisher.taken()
    assert [(topic, fields["active"], fields["text"]) for topic, fields in taken] == [
        ("alarm/bus", True, "no such device"),
        ("alarm/bus", True, "permission denied"),
        ("alarm/bus", False, "permission denied"),
    ]
    began, changed, ended = (fields["since"] for _, fields in taken)
    assert began == changed < ended


def test_a_soil_change_has_its_evidence_as_numbers_also_after_its_end(service: Any) -> None:
    """Onset, wheels, ratio, statistic and probabilities are fields; the alarm latches, and keeps them at its end."""
    publisher = Recorder()
    now_ns = 0
    sink = MqttSink(service, publisher, monotonic_ns=lambda: now_ns)  # type: ignore[arg-type]
    change = Change(1_700_000_030_000_000_000, 1_700_000_012_000_000_000, "fall", "front", 11.2, 10.8, 0.71)
    publisher.estimate = lambda _: None  # type: ignore[attr-defined]
    sink.estimate(replace(estimate(), soil_change=SoilChange(change, FallProbability(0.97, 0.6, 0.9))))
    publisher.taken()
    sink._publish_changes()
    now_ns = 121_000_000_000
    sink._publish_changes()
    published = [fields for topic, fields in publisher.taken() if topic == "alarm/soil-change"]
    assert [fields["active"] for fields in published] == [True, False]
    for fields in published:
        assert fields["text"].startswith("the soil is weaker")
        assert fields["latching"]
        assert fields["evidence"].model_dump() == {
            "onset": iso_time(change.onset_ns),
            "direction": "fall",
            "wheels": (1, 2),
            "torque_ratio": 0.71,
            "statistic": 11.2,
            "threshold": 10.8,
            "cohesion_fell": 0.97,
            "friction_angle_fell": 0.6,
            "drawbar_margin_fell": 0.9,
        }


async def test_a_moving_rover_sends_its_odometry(service: Any) -> None:
    """The dead-reckoned position is a message of its own, with the time of its snapshot."""
    publisher = Recorder()
    publisher.estimate = lambda _: None  # type: ignore[attr-defined]
    sink = MqttSink(service, publisher)  # type: ignore[arg-type]
    sink.estimate(estimate())
    ((topic, fields),) = publisher.taken()
    assert topic == "odometry"
    assert fields["speed_source"] == "ground-speed"


async def test_a_connection_takes_two_windows_of_publishes_without_a_warning(tmp_path: Path) -> None:
    """The threshold above which aiomqtt warns of pending calls is two windows."""

    class NoMessages:
        def birth(self) -> bytes:
            return b"{}"

        def death(self, reason: str) -> bytes:
            return reason.encode()

    stores = Stores.open(tmp_path, 1_000_000)
    outboxes = Outbox(stores.snapshots), Outbox(stores.others)
    connection = Connection(Configuration().mqtt, "regolith/kapvik", outboxes, NoMessages(), asyncio.Event())
    client = connection._client()
    assert client._socket_options == ((socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),)
    assert client.pending_calls_threshold == 2 * (WINDOW + OTHERS_WINDOW)
    assert client.identifier == "regolithd-regolith-kapvik"
    stores.close()


BABBLE_HZ = 1100
"""EMCY messages a second of a node that babbles."""


def emergency(number: int, node_id: int = 13) -> NodeEmergency:
    """Return the event of an EMCY whose vendor bytes hold a number."""
    emcy = Emergency(1_700_000_000_000_000_000 + number, node_id, 0x8130, 0x10, number.to_bytes(5, "big"), "heartbeat")
    return NodeEmergency(emcy.time_ns, node_id, emcy, f"node {node_id}: error")


async def test_a_babbling_node_delays_no_snapshot_and_is_summarised(service: Any, tmp_path: Path) -> None:
    """1100 EMCY a second for 10 s: every snapshot is queued; EMCY are few, and all are counted; an alarm is active."""
    stores = Stores.open(tmp_path, 100_000_000)
    now_ns = 0
    publisher = Publisher(service.configuration, stores)
    sink = MqttSink(service, publisher, monotonic_ns=lambda: now_ns)
    for millisecond in range(10_000):
        now_ns = millisecond * 1_000_000
        for number in range(BABBLE_HZ * millisecond // 1000, BABBLE_HZ * (millisecond + 1) // 1000):
            sink.event(emergency(number))
        if millisecond % 25 == 0:
            sink.publisher.estimate(estimate(millisecond // 25))
        if millisecond % 1000 == 999:
            sink._publish_summaries()
            sink._publish_changes()
    records = [*stored(stores.snapshots), *stored(stores.others)]
    snapshots = [json.loads(payload)["sequence"] for topic, payload in records if topic == "snapshot"]
    emcy = [json.loads(payload) for topic, payload in records if topic == "emcy"]
    assert snapshots == list(range(400))
    assert 10 < len(emcy) < 100
    assert len([topic for topic, _ in records if topic == "event"]) == len(emcy)
    assert len(emcy) + sum(message["suppressed"] for message in emcy) == 10 * BABBLE_HZ
    assert emcy[-1]["vendor_bytes"] == (10 * BABBLE_HZ - 1).to_bytes(5, "big").hex()
    alarms = [json.loads(payload) for topic, payload in records if topic == "alarm/event-rate"]
    assert [alarm["active"] for alarm in alarms] == [True]
    assert "node-emergency of node 13" in alarms[0]["text"]
    now_ns += 11_000_000_000
    sink._publish_changes()
    assert [json.loads(payload)["active"] for topic, payload in stored(stores.others) if topic == "alarm/event-rate"][
        -1
    ] is False
    stores.close()


def stored(spool: Spool) -> list[tuple[str, bytes]]:
    """Return topic and payload of all stored messages."""
    found: list[tuple[str, bytes]] = []
    position = spool.first
    while records := spool.read(position):
        found += [(record.topic, record.payload) for record in records]
        position = records[-1].index + 1
    return found


async def test_a_babbling_node_does_not_delay_the_end(service: Any, mosquitto: Mosquitto, tmp_path: Path) -> None:
    """While EMCY messages keep coming, the sink ends soon after its cancellation, with everything delivered."""
    mqtt = Mqtt(spool_directory=tmp_path, host="127.0.0.1", port=mosquitto.port)
    stores = Stores.open(tmp_path, 100_000_000)
    publisher = Publisher(Configuration(mqtt=mqtt), stores)
    service.liveness = SimpleNamespace(expect=lambda *_: None, ages_s=dict)
    sink = MqttSink(service, publisher)

    async def babble() -> None:
        numbers = count()
        while True:
            for number in islice(numbers, BABBLE_HZ // 100):
                sink.event(emergency(number))
            await asyncio.sleep(0.01)

    babbling = asyncio.create_task(babble())
    running = asyncio.create_task(sink.run())
    await until(lambda: publisher.connected)
    await asyncio.sleep(1.0)
    running.cancel()
    with suppress(asyncio.CancelledError):
        await asyncio.wait_for(running, 20)  # not for as long as the node babbles, which is for ever
    babbling.cancel()
    stores.close()
