"""The daemon's voice: takes estimates and events, never waits, and delivers what must not be lost.

    publisher = Publisher(configuration, spool)
    publisher.estimate(estimate)        # from the pipeline; returns at once, whatever the broker does
    await publisher.run()               # connects, and connects again, until cancelled; then says `offline`

Cancelling `run` is the way to stop: what waits is delivered first, for a bounded time; the rest stays in the store and
comes, marked late, with the next start.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections import Counter
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from aiomqtt import MqttError

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.header import Header, iso_time
from regolithd.daemon.messages.health import PublishingReport
from regolithd.daemon.messages.state import Presence, StateMessage
from regolithd.daemon.publish.backoff import Backoff
from regolithd.daemon.publish.connection import Connection
from regolithd.daemon.publish.connection_errors import reason_of
from regolithd.daemon.publish.encode import encode
from regolithd.daemon.publish.outbox import Outbox

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.daemon.publish.spool import Spool

STOP_WITHIN_S = 4.0
"""How long what waits may take to be delivered at the end, before it is left to the next start."""

HELD_S = 5.0
"""A connection that lasted for less counts as one more failure: brokers throw out a second client of the same name."""

SYNC_EVERY_S = 1.0
"""What has waited for this long is brought to the disk."""

_log = logging.getLogger(__name__)


def new_session(now_ns: int) -> str:
    """Return a name for this run of the daemon that no other has, and that sorts by time."""
    moment = iso_time(now_ns)[:19].replace("-", "").replace(":", "")
    return f"{moment}Z-{secrets.token_hex(2)}"


def software_version() -> str:
    """Return the version of this distribution."""
    try:
        return version("regolithd")
    except PackageNotFoundError:  # run from a checkout
        return "unknown"


class Publisher:
    """Publishes for one rover. One task runs `run`; the rest is called from the same event loop and returns at once.

    Parameters
    ----------
    configuration
        `[rover] name` and `[mqtt]`.
    spool
        Where what must not be lost waits; this publisher is its only user.
    backoff
        How long to wait between attempts to connect.
    beat
        Called at least once a second while this task answers.
    """

    def __init__(
        self,
        configuration: Configuration,
        spool: Spool,
        *,
        backoff: Backoff | None = None,
        beat: Callable[[], None] = lambda: None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._settings = configuration.mqtt
        self._root = f"{configuration.mqtt.prefix}/{configuration.rover.name}"
        self._spool = spool
        self._outbox = Outbox(spool)
        self._backoff = backoff or Backoff()
        self._beat = beat
        self._clock_ns = clock_ns
        self.session = new_session(clock_ns())
        self._version = software_version()
        self._stop = asyncio.Event()
        self._connection: Connection | None = None
        self._connections = 0
        self._sequences: Counter[str] = Counter()
        self._problem = ""
        self._said: set[str] = set()
        self._up_since: float | None = None

    @property
    def connected(self) -> bool:
        """Whether the broker is there, and has acknowledged our birth."""
        return self._connection is not None and self._connection.up

    @property
    def problem(self) -> str:
        """Why there is no connection; empty where there is one."""
        return "" if self.connected else self._problem

    @property
    def report(self) -> PublishingReport:
        """What became of the messages that must not be lost."""
        counters = self._spool.counters
        return PublishingReport(
            connections=self._connections,
            queued=self._spool.queued,
            queued_MB=self._spool.size_bytes / 1e6,
            acknowledged=counters.acknowledged,
            repeated=self._outbox.repeated,
            dropped=counters.dropped,
            unstored=counters.unstored,
            torn=counters.torn,
        )

    def estimate(self, estimate: Estimate) -> None:
        """Publish one SYNC: the snapshot for the record, and the six wheels live."""
        snapshot, wheels = encode(estimate, self.session)
        self._outbox.store("snapshot", snapshot)
        if self.connected:
            self._outbox.show({f"wheel/{k + 1}": payload for k, payload in enumerate(wheels)})

    def say(self, topic: str, message: type[Header], *, time_ns: int | None = None, **fields: Any) -> None:  # noqa: ANN401  # the model checks them
        """Publish any other message on a topic below `<prefix>/<rover>/`, as its channel says."""
        payload = self._write(topic, message, time_ns, fields)
        if _STORED[topic.split("/", 1)[0]]:
            self._outbox.store(topic, payload)
        elif self.connected:
            self._outbox.show({topic: payload})

    def _write(self, topic: str, message: type[Header], time_ns: int | None, fields: dict[str, Any]) -> bytes:
        sequence = self._sequences[topic]
        self._sequences[topic] += 1
        moment = iso_time(self._clock_ns() if time_ns is None else time_ns)
        written = message.model_validate({"session": self.session, "sequence": sequence, "time": moment, **fields})
        return written.model_dump_json().encode()

    def birth(self) -> bytes:
        """Return the `online` of this connection."""
        return self._state(Presence.ONLINE, "connected")

    def death(self, reason: str) -> bytes:
        """Return the `offline` that ends this connection."""
        return self._state(Presence.OFFLINE, reason)

    def _state(self, state: Presence, reason: str) -> bytes:
        message = StateMessage.model_validate(
            {
                "session": self.session,
                "sequence": self._connections,
                "time": iso_time(self._clock_ns()),
                "state": state,
                "reason": reason,
                "software_version": self._version,
            }
        )
        return message.model_dump_json().encode()

    async def run(self) -> None:
        """Deliver until cancelled; then deliver what waits, for a bounded time, and say `offline`."""
        async with asyncio.TaskGroup() as tasks:
            keeper = tasks.create_task(self._keep_on_disk())
            delivery = tasks.create_task(self._deliver())
            try:
                await asyncio.shield(delivery)
            except asyncio.CancelledError:
                self._stop.set()
                self._outbox.arrived.set()
                if not self.connected:
                    delivery.cancel()
                with suppress(TimeoutError):
                    async with asyncio.timeout(STOP_WITHIN_S):
                        await delivery
                raise
            finally:
                keeper.cancel()

    async def _deliver(self) -> None:
        """Connect again and again; return once stopped."""
        while not self._stop.is_set():
            self._connections += 1
            self._connection = Connection(self._settings, self._root, self._outbox, self, self._stop)
            try:
                await self._connection.run(self._say_up, self._beat)
            except (MqttError, OSError) as error:  # OSError: the password file, the certificates
                self._say_down(error)
                await self._pause(self._backoff.next())

    async def _pause(self, delay_s: float) -> None:
        end = time.monotonic() + delay_s
        while not self._stop.is_set() and (left := end - time.monotonic()) > 0:
            self._beat()
            with suppress(TimeoutError):
                async with asyncio.timeout(min(left, 0.5)):
                    await self._stop.wait()

    def _say_up(self) -> None:
        self._up_since = time.monotonic()
        _log.info(
            "connected to the MQTT broker %s:%d; %d messages wait",
            self._settings.host,
            self._settings.port,
            self._spool.queued,
        )

    def _say_down(self, error: Exception) -> None:
        """Say a reason once, not at each attempt."""
        reason = reason_of(error, self._settings)
        if self._up_since is not None and time.monotonic() - self._up_since > HELD_S:
            self._backoff.reset()
        self._up_since = None
        level = logging.DEBUG if reason == self._problem else logging.WARNING
        _log.log(level, "%s The daemon goes on, keeps what must not be lost, and tries again.", reason)
        self._problem = reason

    def _say_once(self, trouble: str) -> None:
        _log.log(logging.DEBUG if trouble in self._said else logging.WARNING, "%s", trouble)
        self._said.add(trouble)

    async def _keep_on_disk(self) -> None:
        """Bring to the disk what has waited for a second; a broker that keeps up spares the disk."""
        first = -1
        while True:
            waits = self._spool.queued and self._spool.first == first
            first = self._spool.first
            if waits:
                # fsync blocks for as long as the disk takes: in a thread, and the only one here.
                try:
                    await asyncio.to_thread(self._spool.begin_sync())
                except OSError as error:
                    self._say_once(f"the store could not be brought to the disk: {error}")
            await asyncio.sleep(SYNC_EVERY_S)


_STORED = {channel.address.split("/", 1)[0]: channel.stored for channel in CHANNELS}
