"""aiomqtt's client with the broker's refusals, and with fewer system calls and tasks for each message.

MQTT 5 acknowledges a message with a reason code.

A broker whose access rules forbid a topic discards the message. To a client of MQTT 3.1.1 it acknowledges it all the
same, so the message would be deleted from the store, and lost. Hence the daemon speaks MQTT 5, and 3.1.1 only with a
broker that has no MQTT 5.
"""

from __future__ import annotations

import asyncio
import logging
import math
import threading
from typing import TYPE_CHECKING, Any, TypeVar

from aiomqtt import Client, MqttCodeError, MqttError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Mapping

    from paho.mqtt.client import Client as PahoClient
    from paho.mqtt.properties import Properties
    from paho.mqtt.reasoncodes import ReasonCode

T = TypeVar("T")
_UNSUPPORTED_PROTOCOL_VERSION = 132  # MQTT 5, 2.4; paho also gives it for return code 1 of MQTT 3.1.1
_NOT_AUTHORIZED = 135
_QUOTA_EXCEEDED = 151
_log = logging.getLogger(__name__)
AIOMQTT_LOG = logging.getLogger("regolithd.daemon.publish.aiomqtt")
AIOMQTT_LOG.setLevel(logging.CRITICAL)  # each error is raised as well, and told by whoever connects


class PublishRefusedError(MqttCodeError):
    """The broker does not take messages of this client; it may do so later."""

    def __init__(self, code: ReasonCode, topic: str) -> None:
        super().__init__(code)
        self.topic = topic


class BrokerClient(Client):
    """A client that notices when the broker refuses a message."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:  # noqa: ANN401  # those of aiomqtt
        super().__init__(*arguments, **keywords)
        self._refusal: ReasonCode | None = None
        self._loop_thread = threading.get_ident()

    def _on_publish(
        self, client: PahoClient, userdata: object, mid: int, reason_code: ReasonCode, properties: Properties
    ) -> None:
        if reason_code.value in {_NOT_AUTHORIZED, _QUOTA_EXCEEDED}:
            self._refusal = reason_code
        elif reason_code.is_failure:  # it would be refused again: it must not block those behind it
            _log.error("a message is refused by the broker, and lost: %s", reason_code)
        super()._on_publish(client, userdata, mid, reason_code, properties)

    async def publish_live(self, messages: Mapping[str, bytes]) -> None:
        """Publish at QoS 0, topic → payload, and return once all are written to the socket.

        aiomqtt waits for each by a task and a timer of its own; they are written in order, so the last is enough.
        """
        *first, last = messages.items()
        for topic, payload in first:
            self._client.publish(topic, payload)
        await self.publish(*last)

    async def _wait_for(self, fut: Awaitable[T], timeout: float | None) -> T:  # noqa: ASYNC109  # aiomqtt's signature
        """Do as aiomqtt does without `asyncio.wait_for`.

        In Python 3.11 that makes a task for each message, and may swallow a cancellation.
        """
        limit_s = self.timeout if timeout is None else timeout
        try:
            async with asyncio.timeout(None if limit_s == math.inf else limit_s):
                return await fut
        except TimeoutError:
            raise MqttError("Operation timed out") from None

    def _on_socket_register_write(self, client: PahoClient, userdata: object, sock: Any) -> None:  # noqa: ANN401, ARG002  # a paho socket
        """Write in this turn of the event loop, everything that is published until then.

        aiomqtt wakes the loop by a pipe and waits until the socket is writable, which it nearly always is: seven system
        calls more for each SYNC.
        """
        if threading.get_ident() == self._loop_thread:
            self._loop.call_soon(self._write_at_once, client, sock)
        else:  # while it connects
            self._loop.call_soon_threadsafe(self._write_at_once, client, sock)

    def _write_at_once(self, client: PahoClient, sock: Any) -> None:  # noqa: ANN401  # a paho socket
        self._write(client)
        # A socket that was closed meanwhile is left alone: its number may be another file's.
        if client.want_write() and sock.fileno() >= 0:
            self._loop.add_writer(sock.fileno(), self._write, client)

    def _write(self, client: PahoClient) -> None:
        try:
            client.loop_write()
        except Exception as error:  # noqa: BLE001  # whatever it is, the connection is lost
            if not self._disconnected.done():
                self._disconnected.set_exception(error)

    async def publish_acknowledged(self, topic: str, payload: bytes, *, retain: bool) -> None:
        """Publish at QoS 1, and return once the broker has acknowledged it.

        Raises
        ------
        PublishRefusedError
            The broker refused this message or, in the same connection, another one.
        ValueError
            No client can send this message.
        MqttError
            The connection is lost.
        """
        await self.publish(topic, payload, qos=1, retain=retain)
        if self._refusal is not None:
            raise PublishRefusedError(self._refusal, topic)


def lacks_mqtt_5(error: Exception) -> bool:
    """Return whether the broker refused the connection because of the protocol's version."""
    return isinstance(error, MqttCodeError) and getattr(error.rc, "value", None) == _UNSUPPORTED_PROTOCOL_VERSION
