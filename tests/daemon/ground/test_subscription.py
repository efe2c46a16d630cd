"""The subscription: which topics, what is handed on in which batches, and what is acknowledged when."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from ground_messages import EXAMPLES, received

from regolithd.daemon.ground.settings import Broker
from regolithd.daemon.ground.subscription import BATCH, Subscription, is_stored

if TYPE_CHECKING:
    from regolithd.daemon.ground.received import Received


class Messages:
    """Messages that have arrived; iteration ends when there is none."""

    def __init__(self, arrived: list[Any]) -> None:
        self._arrived = arrived

    def __len__(self) -> int:
        return len(self._arrived)

    def __aiter__(self) -> Messages:
        return self

    async def __anext__(self) -> Any:
        """Return the next message."""
        if not self._arrived:
            raise StopAsyncIteration
        return self._arrived.pop(0)


class Client:
    """An MQTT client that keeps what is asked of it."""

    def __init__(self, arrived: list[Any] = []) -> None:  # noqa: B006  # only read
        self.topics: list[tuple[str, int]] = []
        self.acknowledged: list[tuple[int, int]] = []
        self.messages = Messages(list(arrived))
        self._client = SimpleNamespace(ack=lambda mid, qos: self.acknowledged.append((mid, qos)))

    async def subscribe(self, topics: list[tuple[str, int]]) -> None:
        """Keep the topics."""
        self.topics = topics


def message(number: int, payload: bytes | None = None) -> Any:
    """Return a message of an event."""
    content = json.dumps(EXAMPLES["event"]).encode() if payload is None else payload
    return SimpleNamespace(topic="regolith/kapvik/event", payload=content, mid=number, qos=1)


async def test_every_channel_but_the_repeated_ones_is_subscribed() -> None:
    """Of all rovers; each with its own quality of service."""
    client: Any = Client()
    await Subscription(Broker(), lambda _: None)._subscribe(client)
    topics = dict(client.topics)
    assert (topics["regolith/+/snapshot"], topics["regolith/+/health"]) == (1, 0)
    assert "regolith/+/alarm/+" in topics
    assert not [topic for topic in topics if "/wheel/" in topic]
    assert len(topics) == len(EXAMPLES) - 1


async def test_messages_are_acknowledged_after_they_were_taken() -> None:
    """In batches of at most twenty, so that a ground that is killed meanwhile gets them again."""
    client: Any = Client([message(number) for number in range(BATCH + 3)])
    batches: list[tuple[int, int]] = []

    def take(parsed: list[Received]) -> None:
        batches.append((len(parsed), len(client.acknowledged)))

    await Subscription(Broker(), take)._receive(client)
    assert batches == [(BATCH, 0), (3, BATCH)]
    assert client.acknowledged == [(number, 1) for number in range(BATCH + 3)]


async def test_what_cannot_be_read_is_counted_and_acknowledged() -> None:
    """It would come again for ever; the deletion of a retained message is none."""
    client: Any = Client([message(0, b"no JSON"), message(1, b""), message(2)])
    taken: list[Received] = []
    subscription = Subscription(Broker(), taken.extend)
    await subscription._receive(client)
    assert [each.channel for each in taken] == ["event"]
    assert subscription.refused == 1
    assert [mid for mid, _ in client.acknowledged] == [0, 1, 2]


def test_each_change_of_the_connection_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    """A problem as a warning, the connection as information; whoever shows it is called each time."""
    changes: list[int] = []
    subscription = Subscription(Broker(), lambda _: None, lambda: changes.append(1))
    assert subscription.problem == "not connected yet"
    with caplog.at_level("INFO"):
        for problem in ("refused", "refused", "", ""):
            subscription._set_problem(problem)
    assert [(record.levelname, record.message) for record in caplog.records] == [
        ("WARNING", "refused"),
        ("INFO", "connected to the MQTT broker"),
    ]
    assert (subscription.problem, len(changes)) == ("", 4)


@pytest.mark.parametrize(("topic", "stored"), [("snapshot", True), ("event", True), ("health", False)])
def test_what_arrives_at_least_once_is_stored(topic: str, stored: bool) -> None:
    """The rest is shown only."""
    assert is_stored(received(topic, 1)) == stored
