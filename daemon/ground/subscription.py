"""The subscription: one persistent MQTT session, each message acknowledged once it is stored.

The broker keeps what is published while the ground is away (mosquitto: at most `max_queued_messages`), because the
session is persistent and QoS is 1. A message is acknowledged after the transaction that stores it: a ground that is
killed gets it again. What arrives twice is stored once.
"""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING

from aiomqtt import Client, Message, MqttError

from regolithd.daemon.ground.received import STORED, MessageError, parse
from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.publish.backoff import Backoff
from regolithd.daemon.publish.connection_errors import explain
from regolithd.daemon.publish.credentials import password_of, tls_context
from regolithd.daemon.publish.transport import transport_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.ground.received import Received
    from regolithd.daemon.ground.settings import Broker

BATCH = 20
"""Messages of one transaction: mosquitto sends this many before it waits for acknowledgements."""
TIMEOUT_S = 5.0
"""A broker that does not answer for this long is not there."""
LIVE_ONLY = "wheel"
"""`wheel/…` repeats what `snapshot` has, and is not subscribed."""

_log = logging.getLogger(__name__)


class Subscription:
    """Receives the messages of all rovers.

    Parameters
    ----------
    settings
        The broker.
    take
        Called with the messages of a batch. Those on stored channels are acknowledged when it returns.
    changed
        Called when the connection is made or lost.
    """

    def __init__(
        self, settings: Broker, take: Callable[[list[Received]], None], changed: Callable[[], None] = lambda: None
    ) -> None:
        self._settings = settings
        self._take = take
        self._changed = changed
        self._backoff = Backoff()
        self.problem = "not connected yet"
        self.refused = 0

    async def run(self) -> None:
        """Receive until cancelled; reconnect after each loss."""
        while True:
            try:
                async with self._client() as client:
                    await self._subscribe(client)
                    self._set_problem("")
                    self._backoff.reset()
                    await self._receive(client)
            except (MqttError, OSError) as error:
                self._set_problem(await explain(error, self._settings))
                await asyncio.sleep(self._backoff.next())

    def _client(self) -> Client:
        settings, transport = self._settings, transport_of(self._settings)
        transport.check_accepts()
        client = Client(
            transport.host,
            transport.port,
            transport=transport.kind,
            username=settings.username,
            password=password_of(settings),
            identifier=settings.client_id,
            clean_session=False,
            keepalive=settings.keepalive_s,
            timeout=TIMEOUT_S,
            tls_context=tls_context(settings),
            socket_options=transport.socket_options,
            logger=_aiomqtt_log,
        )
        client._client.manual_ack_set(on=True)  # noqa: SLF001  # paho's interface, which aiomqtt does not pass on
        return client

    async def _subscribe(self, client: Client) -> None:
        topics = []
        for channel in CHANNELS:
            if channel.name != LIVE_ONLY:
                levels = ["+" if level.startswith("{") else level for level in channel.address.split("/")]
                topics.append((f"{self._settings.prefix}/+/{'/'.join(levels)}", int(channel.qos)))
        await client.subscribe(topics)

    async def _receive(self, client: Client) -> None:
        messages = client.messages
        async for first in messages:
            batch = [first]
            while len(batch) < BATCH and len(messages):
                batch.append(await anext(messages))
            self._take(self._parsed(batch))
            for message in batch:
                client._client.ack(message.mid, message.qos)  # noqa: SLF001  # as above

    def _parsed(self, batch: list[Message]) -> list[Received]:
        parsed = []
        for message in batch:
            payload = message.payload
            if not payload:
                continue  # a retained message was deleted
            try:
                parsed.append(parse(self._settings.prefix, str(message.topic), bytes(payload)))
            except MessageError as error:
                self.refused += 1
                _log.warning("%s", error)
        return parsed

    def _set_problem(self, problem: str) -> None:
        if problem != self.problem:
            _log.log(logging.WARNING if problem else logging.INFO, "%s", problem or "connected to the MQTT broker")
        self.problem = problem
        self._changed()


def is_stored(message: Received) -> bool:
    """Return whether a message goes into the store; `health` is shown only."""
    return message.channel in STORED


_aiomqtt_log = logging.getLogger("regolithd.daemon.ground.aiomqtt")
_aiomqtt_log.setLevel(logging.CRITICAL)  # each error is logged once, by the subscription
