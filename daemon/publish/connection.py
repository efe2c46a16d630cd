"""One connection to the MQTT broker, from its birth message to its death message.

| task | does |
|---|---|
| `_send_stored`, for each store | sends its messages in order, at most `WINDOW` or `OTHERS_WINDOW` unacknowledged |
| `_send_live` | sends live messages |
| `_wait_for_loss` | raises `MqttError` when the connection is lost |
| `_beat` | reports that the publishing task runs |

A publish that is not acknowledged within `ACKNOWLEDGE_TIMEOUT_S` ends the connection. aiomqtt sends a DISCONNECT
whenever its context is left, and the broker then discards the will. Hence the death message is published explicitly,
whatever ends the connection; only where the connection is lost does the broker publish the will.
"""

from __future__ import annotations

import asyncio
import logging
import math
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from aiomqtt import MqttError, ProtocolVersion, Will

from regolithd.daemon.publish.broker_client import AIOMQTT_LOG, BrokerClient
from regolithd.daemon.publish.credentials import password_of, tls_context
from regolithd.daemon.publish.transport import transport_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.config.configuration import Mqtt
    from regolithd.daemon.publish.outbox import Outbox, OutgoingMessage

WINDOW = 64
"""Snapshots that may be unacknowledged at a time: 1280 a second at a round-trip time of 50 ms."""

OTHERS_WINDOW = 16
"""Other stored messages that may be unacknowledged at a time. Snapshots do not wait for them."""

MAX_LATE_PER_S = 1000.0
"""Rate limit for late messages. A broker drops messages that a slow subscriber does not take (mosquitto: over 1000)."""

ACKNOWLEDGE_TIMEOUT_S = 5.0
"""A publish that is not acknowledged for this long: the broker hangs. Shorter than MQTT's keepalive."""

DEATH_TIMEOUT_S = 0.5
"""Time for the death message, and as much for the DISCONNECT, of a connection that has failed or was cancelled."""

_AT_LEAST_ONCE = 1
_LATE_BATCH = 20


class StateMessages(Protocol):
    """Makes the birth and death messages of a connection: payloads of the `state` topic."""

    def birth(self) -> bytes:
        """Return `online`."""

    def death(self, reason: str) -> bytes:
        """Return `offline`."""


class _Way:
    """The way out of one store: what waits, and how much may be unacknowledged."""

    def __init__(self, outbox: Outbox, window: int) -> None:
        self.outbox = outbox
        self.window = asyncio.Semaphore(window)


class Connection:
    """One connection. `run` returns once `stop` is set and everything is sent; it raises `MqttError` if it is lost."""

    def __init__(
        self,
        settings: Mqtt,
        root: str,
        outboxes: tuple[Outbox, Outbox],
        state_messages: StateMessages,
        stop: asyncio.Event,
        *,
        protocol: ProtocolVersion = ProtocolVersion.V5,
    ) -> None:
        self._protocol = protocol
        self._settings = settings
        self._root = root
        snapshots, others = outboxes
        self._ways = (_Way(snapshots, WINDOW), _Way(others, OTHERS_WINDOW))
        self._live = others
        self._state_messages = state_messages
        self._stop = stop
        self._late = 0
        self._limiting = asyncio.Lock()
        self.up = False

    async def run(self, on_connected: Callable[[], None], beat: Callable[[], None]) -> None:
        """Connect, publish the birth, send until stopped or lost, publish the death.

        `on_connected` is called once the birth is acknowledged.
        """
        reason = "failed"
        async with self._client() as client:
            try:
                await self._publish_birth(client)
                self.up = True
                on_connected()
                await self._send(client, beat)
                reason = "stopped"
            finally:
                self.up = False
                await self._publish_death(client, reason)

    def _client(self) -> BrokerClient:
        settings, transport = self._settings, transport_of(self._settings)
        transport.check_accepts()
        client = BrokerClient(
            transport.host,
            transport.port,
            transport=transport.kind,
            username=settings.username,
            password=password_of(settings),
            identifier=f"regolithd-{self._root.replace('/', '-')}",
            will=Will(
                f"{self._root}/state", self._state_messages.death("connection-lost"), qos=_AT_LEAST_ONCE, retain=True
            ),
            protocol=self._protocol,
            clean_session=True if self._protocol is ProtocolVersion.V311 else None,  # MQTT 5: a clean start
            keepalive=settings.keepalive_s,
            timeout=ACKNOWLEDGE_TIMEOUT_S,
            max_inflight_messages=WINDOW + OTHERS_WINDOW,
            tls_context=tls_context(settings),
            socket_options=transport.socket_options,
            logger=AIOMQTT_LOG,
        )
        client.pending_calls_threshold = 2 * (WINDOW + OTHERS_WINDOW)
        return client

    async def _publish_birth(self, client: BrokerClient) -> None:
        await self._publish(client, "state", self._state_messages.birth(), retain=True)
        for way in self._ways:
            for topic, payload in way.outbox.connected().items():
                await self._publish(client, topic, payload, retain=True)

    async def _send(self, client: BrokerClient, beat: Callable[[], None]) -> None:
        """Send until everything is sent after `stop`, or until the connection is lost."""
        lost: MqttError | None = None
        try:
            async with asyncio.TaskGroup() as tasks:
                background = [
                    tasks.create_task(self._wait_for_loss(client)),
                    tasks.create_task(self._send_live(client)),
                    tasks.create_task(self._beat(beat)),
                ]
                await asyncio.wait([tasks.create_task(self._send_stored(client, tasks, way)) for way in self._ways])
                for task in background:
                    task.cancel()
        except* MqttError as group:
            lost = _first(group)
        if lost is not None:  # raised outside the group, so that its context is not the group
            raise lost

    @staticmethod
    async def _wait_for_loss(client: BrokerClient) -> None:
        """Wait until the connection is lost. No message comes: the daemon subscribes to nothing."""
        async for _ in client.messages:
            continue

    @staticmethod
    async def _beat(beat: Callable[[], None]) -> None:
        while True:
            beat()
            await asyncio.sleep(0.5)

    async def _send_stored(self, client: BrokerClient, tasks: asyncio.TaskGroup, way: _Way) -> None:
        outbox = way.outbox
        while not (self._stop.is_set() and not outbox.spool.queued):
            for message in outbox.waiting():
                await way.window.acquire()
                outbox.sent(message)
                tasks.create_task(self._deliver(client, way, message))
                if message.late:
                    await self._limit_late()
            await outbox.arrived.wait()

    async def _limit_late(self) -> None:
        """Wait so that both ways together keep to `MAX_LATE_PER_S`."""
        self._late += 1
        if self._late % _LATE_BATCH == 0:
            async with self._limiting:
                await asyncio.sleep(_LATE_BATCH / MAX_LATE_PER_S)

    async def _deliver(self, client: BrokerClient, way: _Way, message: OutgoingMessage) -> None:
        try:
            await self._publish(client, message.topic, message.payload, retain=message.retain)
            way.outbox.acknowledged(message)
        except ValueError as error:  # the client refuses it, whatever is tried: it must not block those behind it
            _log.error("a message on %s cannot be published and is discarded: %s", message.topic, error)
            way.outbox.acknowledged(message)
        finally:
            way.window.release()
        if self._stop.is_set():
            way.outbox.arrived.set()  # the last acknowledgement ends the loop

    async def _send_live(self, client: BrokerClient) -> None:
        while True:
            await self._live.live_arrived.wait()
            messages = self._live.take_live()
            if messages:
                await client.publish_live({f"{self._root}/{topic}": payload for topic, payload in messages.items()})

    async def _publish(self, client: BrokerClient, topic: str, payload: bytes, *, retain: bool) -> None:
        await client.publish_acknowledged(f"{self._root}/{topic}", payload, retain=retain)

    async def _publish_death(self, client: BrokerClient, reason: str) -> None:
        client.timeout = DEATH_TIMEOUT_S  # also of the DISCONNECT that follows
        with suppress(MqttError, TimeoutError):
            async with asyncio.timeout(DEATH_TIMEOUT_S if reason == "failed" else ACKNOWLEDGE_TIMEOUT_S):
                payload = self._state_messages.death(reason)
                await client.publish(f"{self._root}/state", payload, qos=_AT_LEAST_ONCE, retain=True, timeout=math.inf)


def _first(group: BaseExceptionGroup[MqttError]) -> MqttError:
    error: BaseException = group
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    assert isinstance(error, MqttError)  # noqa: S101  # the group holds nothing else
    return error


_log = logging.getLogger(__name__)
