"""Which messages the MQTT sink publishes, with a publisher that only records them."""

import asyncio
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.health.alarms import alarm_names
from regolithd.daemon.messages.header import iso_time
from regolithd.daemon.messages.health import PublishingReport
from regolithd.daemon.publish.connection import WINDOW, Connection
from regolithd.daemon.publish.mqtt_sink import MqttSink
from regolithd.daemon.publish.outbox import Outbox
from regolithd.daemon.publish.spool import Spool

NO_MESSAGES = PublishingReport(
    connections=0, queued=0, queued_MB=0.0, acknowledged=0, repeated=0, dropped=0, unstored=0, damaged=0, torn=0
)


@dataclass
class Recorder:
    """A publisher that keeps topic and fields of each message."""

    report: PublishingReport = NO_MESSAGES
    published: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def publish(self, topic: str, message: type, *, time_ns: int, **fields: Any) -> None:
        """Keep a message that its model accepts."""
        message.model_validate({"session": "s", "sequence": 0, "time": iso_time(time_ns), **fields})
        self.published.append((topic, fields))

    def taken(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the messages since the last call."""
        taken, self.published = self.published, []
        return taken


@pytest.fixture
def service() -> Any:
    """A service whose bus is not open yet, without problems."""
    return SimpleNamespace(configuration=Configuration(), network=None, recorder=None, bus_problem="")


def test_at_the_start_every_alarm_is_published_once_as_not_active(service: Any) -> None:
    """The broker may have retained an active one of an earlier run."""
    publisher = Recorder()
    sink = MqttSink(service, publisher)  # type: ignore[arg-type]
    sink._publish_changes()
    names = alarm_names(node.node_id for node in service.configuration.nodes.described())
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
    published = [(topic, fields["active"], fields["text"]) for topic, fields in publisher.taken()]
    assert published == [
        ("alarm/bus", True, "no such device"),
        ("alarm/bus", True, "permission denied"),
        ("alarm/bus", False, ""),
    ]


async def test_a_connection_takes_two_windows_of_publishes_without_a_warning(tmp_path: Path) -> None:
    """The threshold above which aiomqtt warns of pending calls is two windows."""

    class NoMessages:
        def birth(self) -> bytes:
            return b"{}"

        def death(self, reason: str) -> bytes:
            return reason.encode()

    outbox = Outbox(Spool(tmp_path, 1_000_000))
    connection = Connection(Configuration().mqtt, "regolith/kapvik", outbox, NoMessages(), asyncio.Event())
    client = connection._client()
    assert client.pending_calls_threshold == 2 * WINDOW
    assert client.identifier == "regolithd-regolith-kapvik"
    outbox.spool.close()
