"""One connection to the broker: from birth to death, with everything that is sent in between.

Four tasks live in it: one notices that the connection is lost, one sends what is stored, in order, with a window of
unacknowledged messages, one sends what is live, and one ends a connection on which nothing is acknowledged any more.

aiomqtt sends a clean DISCONNECT whenever its context is left, so the broker then forgets the will. Hence `offline` is
published by ourselves on every way out but the loss of the connection.
"""

from __future__ import annotations

import asyncio
import logging
import ssl
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from aiomqtt import Client, MqttError, Will

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.config.configuration import Mqtt
    from regolithd.daemon.publish.outbox import Outbox, OutgoingMessage

WINDOW = 64
"""How many stored messages may be on their way unacknowledged: a broker 50 ms away then takes 1280 a second."""

LATE_PER_S = 1000.0
"""How fast a backlog is sent at most. A broker drops what its subscribers are too slow for (mosquitto: beyond 1000)."""

ACKNOWLEDGE_WITHIN_S = 5.0
"""Nothing acknowledged for this long: the broker hangs. Shorter than keepalive would notice."""

FAREWELL_WITHIN_S = 2.0

_AT_LEAST_ONCE = 1
_LATE_BATCH = 20


class StateMessages(Protocol):
    """What is said at the beginning and the end of a connection; payloads of the `state` topic."""

    def birth(self) -> bytes:
        """Return `online`."""

    def death(self, reason: str) -> bytes:
        """Return `offline`."""


class Connection:
    """One connection. `run` returns when `stop` is set and everything is sent; raises `MqttError` when it is lost."""

    def __init__(
        self, settings: Mqtt, root: str, outbox: Outbox, state_messages: StateMessages, stop: asyncio.Event
    ) -> None:
        self._settings = settings
        self._root = root
        self._outbox = outbox
        self._state_messages = state_messages
        self._stop = stop
        self._window = asyncio.Semaphore(WINDOW)
        self.up = False

    async def run(self, on_up: Callable[[], None], beat: Callable[[], None]) -> None:
        """Connect, say birth, send until stopped or lost, say death. `on_up` is called once birth is acknowledged."""
        reason = "failed"
        async with self._client() as client:
            try:
                await self._be_born(client)
                self.up = True
                on_up()
                await self._send(client, beat)
                reason = "stopped"
            finally:
                self.up = False
                await self._say_death(client, reason)

    def _client(self) -> Client:
        settings = self._settings
        password = settings.password_file.read_text().strip() if settings.password_file else None
        client = Client(
            settings.host,
            settings.port,
            username=settings.username,
            password=password,
            identifier=f"regolithd-{self._root.replace('/', '-')}",
            will=Will(
                f"{self._root}/state", self._state_messages.death("connection-lost"), qos=_AT_LEAST_ONCE, retain=True
            ),
            clean_session=True,
            keepalive=settings.keepalive_s,
            timeout=ACKNOWLEDGE_WITHIN_S,
            max_inflight_messages=WINDOW,
            tls_context=tls_context(settings),
            logger=_quiet,
        )
        client.pending_calls_threshold = 2 * WINDOW
        return client

    async def _be_born(self, client: Client) -> None:
        await self._publish(client, "state", self._state_messages.birth(), retain=True)
        for topic, payload in self._outbox.connected().items():
            await self._publish(client, topic, payload, retain=True)

    async def _send(self, client: Client, beat: Callable[[], None]) -> None:
        """Send until everything is sent after `stop`, or until the connection is lost."""
        lost: MqttError | None = None
        try:
            async with asyncio.TaskGroup() as tasks:
                background = [
                    tasks.create_task(self._watch(client)),
                    tasks.create_task(self._send_live(client)),
                    tasks.create_task(self._beat(beat)),
                ]
                await self._send_stored(client, tasks)
                for task in background:
                    task.cancel()
        except* MqttError as group:
            lost = _first(group)
        if lost is not None:  # raised here, it has no context but its own
            raise lost

    @staticmethod
    async def _watch(client: Client) -> None:
        """Wait for the connection's loss. No message ever comes: the daemon subscribes to nothing."""
        async for _ in client.messages:
            continue

    @staticmethod
    async def _beat(beat: Callable[[], None]) -> None:
        while True:
            beat()
            await asyncio.sleep(0.5)

    async def _send_stored(self, client: Client, tasks: asyncio.TaskGroup) -> None:
        late = 0
        while not (self._stop.is_set() and not self._outbox.spool.queued):
            for message in self._outbox.waiting():
                await self._window.acquire()
                self._outbox.sent(message)
                tasks.create_task(self._deliver(client, message))
                late += message.late
                if late >= _LATE_BATCH:
                    late = 0
                    await asyncio.sleep(_LATE_BATCH / LATE_PER_S)
            await self._outbox.arrived.wait()

    async def _deliver(self, client: Client, message: OutgoingMessage) -> None:
        try:
            await self._publish(client, message.topic, message.payload, retain=message.retain)
            self._outbox.acknowledged(message)
        finally:
            self._window.release()
        if self._stop.is_set():
            self._outbox.arrived.set()  # the last one ends the loop

    async def _send_live(self, client: Client) -> None:
        while True:
            await self._outbox.live_arrived.wait()
            messages = self._outbox.take_live()
            # At once, so that they leave in one write; the next are taken only when these have left.
            await asyncio.gather(*(client.publish(f"{self._root}/{topic}", messages[topic]) for topic in messages))

    async def _publish(self, client: Client, topic: str, payload: bytes, *, retain: bool) -> None:
        await client.publish(f"{self._root}/{topic}", payload, qos=_AT_LEAST_ONCE, retain=retain)

    async def _say_death(self, client: Client, reason: str) -> None:
        with suppress(MqttError, TimeoutError):
            async with asyncio.timeout(FAREWELL_WITHIN_S):
                await self._publish(client, "state", self._state_messages.death(reason), retain=True)


def tls_context(settings: Mqtt) -> ssl.SSLContext | None:
    """Return what `[mqtt] tls` and `ca_file` ask for; without a file, the system's authorities count."""
    return ssl.create_default_context(cafile=settings.ca_file) if settings.tls else None


def _first(group: BaseExceptionGroup[MqttError]) -> MqttError:
    error: BaseException = group
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    assert isinstance(error, MqttError)  # noqa: S101  # the group holds nothing else
    return error


_quiet = logging.getLogger("regolithd.daemon.publish.aiomqtt")
_quiet.setLevel(logging.CRITICAL)  # what it has to say is said once, by the publisher
