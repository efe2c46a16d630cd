"""An MQTT subscriber with a persistent session that keeps all messages, and assertions about them."""

from __future__ import annotations

import asyncio
import json
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import aiomqtt

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from paho.mqtt.client import MQTTMessage


@dataclass
class Subscriber:
    """Keeps every message as (topic, content, retained), and reconnects to the same session (`clean_session=False`)."""

    port: int
    topic: str = "regolith/#"
    name: str = "subscriber"
    messages: list[tuple[str, dict[str, Any], bool]] = field(default_factory=list)
    repeated_by_broker: set[int] = field(default_factory=set)  # indices of messages with MQTT's DUP flag
    ready: asyncio.Event = field(default_factory=asyncio.Event)

    async def run(self) -> None:
        """Receive until cancelled; reconnect after an error."""
        while True:
            with suppress(aiomqtt.MqttError):
                client = aiomqtt.Client("127.0.0.1", self.port, identifier=self.name, clean_session=False)
                # aiomqtt's messages have no `dup`. What waits in the session comes with the acknowledgement of CONNECT.
                client._client.on_message = self._take
                async with client:
                    await client.subscribe(self.topic, qos=1)
                    self.ready.set()
                    async for _ in client.messages:
                        pass
            self.ready.clear()
            await asyncio.sleep(0.05)

    def _take(self, _client: object, _userdata: object, message: MQTTMessage) -> None:
        topic = message.topic.removeprefix("regolith/kapvik/")
        self.messages.append((topic, json.loads(message.payload), message.retain))
        if message.dup:
            self.repeated_by_broker.add(len(self.messages) - 1)

    def of(self, topic: str) -> list[dict[str, Any]]:
        """Return the messages of a topic."""
        return [message for at, message, _ in self.messages if at == topic]

    def sequences(self, topic: str = "snapshot") -> list[int]:
        """Return the sequence numbers of a topic's messages, without late repetitions."""
        seen = [message["sequence"] for message in self.of(topic)]
        return list(dict.fromkeys(seen))


async def until(condition: Callable[[], object], seconds: float = 30) -> None:
    """Wait until a condition holds; TimeoutError after `seconds`."""
    async with asyncio.timeout(seconds):
        while not condition():  # noqa: ASYNC110  # a condition has no event
            await asyncio.sleep(0.02)


@asynccontextmanager
async def listening(subscriber: Subscriber) -> AsyncIterator[Subscriber]:
    """Run a subscriber while the context lasts."""
    task = asyncio.create_task(subscriber.run())
    try:
        await until(subscriber.ready.is_set)
        yield subscriber
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


def assert_complete(subscriber: Subscriber, count: int) -> None:
    """Assert that `count` snapshots came, in order, and that a repetition is marked late."""
    came = subscriber.sequences()
    assert came == list(range(count)), f"lost {set(range(count)) - set(came)}; they came as {came}"
    seen: set[int] = set()
    for place, (topic, message, _) in enumerate(subscriber.messages):
        if topic == "snapshot":
            assert message["sequence"] not in seen or message["late"] or place in subscriber.repeated_by_broker
            seen.add(message["sequence"])
