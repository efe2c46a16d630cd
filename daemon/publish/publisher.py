"""The MQTT publisher: takes messages without waiting, and delivers the stored ones at least once, in order.

    publisher = Publisher(configuration, stores)
    publisher.estimate(estimate)        # from the pipeline; returns at once, whatever the broker does
    await publisher.run()               # connects and reconnects until cancelled; then publishes `offline`

Stored messages (`Channel.stored`) go through the store on disk; live messages are sent only while connected, and a
newer one replaces an older one that still waits. Cancelling `run` is the way to stop: waiting messages are delivered
first, for at most `STOP_TIMEOUT_S`; the rest stays in the store and is sent, marked late, after the next start.
"""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import time
from collections import Counter
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from aiomqtt import MqttError, ProtocolVersion

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.header import Header, iso_time, time_fields
from regolithd.daemon.messages.health import PublishingReport
from regolithd.daemon.messages.state import Presence, StateMessage
from regolithd.daemon.publish.backoff import Backoff
from regolithd.daemon.publish.broker_client import lacks_mqtt_5
from regolithd.daemon.publish.connection import Connection
from regolithd.daemon.publish.connection_errors import explain
from regolithd.daemon.publish.encode import encode
from regolithd.daemon.publish.outbox import Outbox

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.daemon.publish.spool import Spool
    from regolithd.daemon.publish.stores import Stores

STOP_TIMEOUT_S = 1.5
"""Time for the delivery of waiting messages when the daemon stops; the others stay in the store.

With the time to stop the drives before it, and two `DEATH_TIMEOUT_S` after it, SIGTERM is obeyed within 5 s.
"""

STABLE_CONNECTION_S = 5.0
"""A shorter connection counts as a failed attempt: a broker disconnects a second client with the same identifier."""

LIVE_RATE_Hz = 20.0
"""The `wheel/…` messages are for displays: a display that wants every SYNC reads `snapshot`, which has all wheels."""

DISK_SYNC_PERIOD_S = 1.0
"""Messages that have waited for this long are synced to the disk."""

_log = logging.getLogger(__name__)


def new_session(now_ns: int) -> str:
    """Return a unique name for this run of the daemon; names sort by start time."""
    moment = iso_time(now_ns)[:19].replace("-", "").replace(":", "")
    return f"{moment}Z-{secrets.token_hex(2)}"


def software_version() -> str:
    """Return the version of this distribution."""
    try:
        return version("regolithd")
    except PackageNotFoundError:  # run from a checkout
        return "unknown"


class Publisher:
    """Publishes for one rover. One task runs `run`; the other methods are called in its event loop and return at once.

    Parameters
    ----------
    configuration
        `[rover] name` and `[mqtt]`.
    stores
        The stores on disk; this publisher is their only user.
    backoff
        Delays between attempts to connect.
    beat
        Called at least once a second while this task runs.
    """

    def __init__(
        self,
        configuration: Configuration,
        stores: Stores,
        *,
        backoff: Backoff | None = None,
        beat: Callable[[], None] = lambda: None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._settings = configuration.mqtt
        self._root = f"{configuration.mqtt.prefix}/{configuration.rover.name}"
        self._stores = stores
        self._syncs_per_live = math.ceil(configuration.sync.rate_Hz / LIVE_RATE_Hz)
        self._snapshots, self._others = (Outbox(store) for store in stores.both)
        self._backoff = backoff or Backoff()
        self._beat = beat
        self._clock_ns = clock_ns
        self.session = new_session(clock_ns())
        self._version = software_version()
        self._stop = asyncio.Event()
        self._connection: Connection | None = None
        self._protocol = ProtocolVersion.V5
        self._connections = 0
        self._sequences: Counter[str] = Counter()
        self._problem = ""
        self._logged: set[str] = set()
        self._up_since: float | None = None

    @property
    def connected(self) -> bool:
        """Whether there is a connection, and the broker has acknowledged its birth message."""
        return self._connection is not None and self._connection.up

    @property
    def problem(self) -> str:
        """Why there is no connection; empty while there is one."""
        return "" if self.connected else self._problem

    @property
    def recent_problem(self) -> str:
        """Why there is no connection, or why the last one ended, until one has lasted `STABLE_CONNECTION_S`."""
        up = self._up_since
        stable = self.connected and up is not None and time.monotonic() - up > STABLE_CONNECTION_S
        return "" if stable else self._problem

    @property
    def store_problem(self) -> str:
        """Why messages are kept in memory only; empty while they are stored."""
        return self._stores.problem

    @property
    def report(self) -> PublishingReport:
        """Counts of the stored messages, for the `health` message."""
        counters = [store.counters for store in self._stores.both]
        return PublishingReport(
            connections=self._connections,
            queued=self._stores.queued,
            queued_MB=sum(store.size_bytes for store in self._stores.both) / 1e6,
            acknowledged=sum(each.acknowledged for each in counters),
            repeated=self._snapshots.repeated + self._others.repeated,
            dropped=sum(each.dropped for each in counters),
            unstored=sum(each.unstored for each in counters),
            damaged=sum(each.damaged for each in counters),
            torn=sum(each.torn for each in counters),
        )

    def estimate(self, estimate: Estimate) -> None:
        """Publish the estimate of one SYNC: `snapshot` stored, and the six `wheel/…` live, at most `LIVE_RATE_Hz`."""
        live = self.connected and estimate.snapshot.sequence % self._syncs_per_live == 0
        snapshot, wheels = encode(estimate, self.session, with_wheels=live)
        self._snapshots.store("snapshot", snapshot)
        if live:
            self._others.add_live({f"wheel/{k + 1}": payload for k, payload in enumerate(wheels)})

    def publish(self, topic: str, message: type[Header], *, time_ns: int | None = None, **fields: Any) -> None:  # noqa: ANN401  # the model checks them
        """Publish another message on a topic below `<prefix>/<rover>/`, stored or live as its channel says."""
        payload = self._write(topic, message, time_ns, fields)
        if _STORED[topic.split("/", 1)[0]]:
            self._others.store(topic, payload)
        elif self.connected:
            self._others.add_live({topic: payload})

    def _write(self, topic: str, message: type[Header], time_ns: int | None, fields: dict[str, Any]) -> bytes:
        sequence = self._sequences[topic]
        self._sequences[topic] += 1
        moment = time_fields(self._clock_ns() if time_ns is None else time_ns)
        written = message.model_validate({"session": self.session, "sequence": sequence, **moment, **fields})
        return written.model_dump_json().encode()

    def birth(self) -> bytes:
        """Return the birth message of this connection: `online`."""
        return self._state(Presence.ONLINE, "connected")

    def death(self, reason: str) -> bytes:
        """Return the death message of this connection: `offline`."""
        return self._state(Presence.OFFLINE, reason)

    def _state(self, state: Presence, reason: str) -> bytes:
        message = StateMessage.model_validate(
            {
                "session": self.session,
                "sequence": self._connections,
                **time_fields(self._clock_ns()),
                "state": state,
                "reason": reason,
                "software_version": self._version,
            }
        )
        return message.model_dump_json().encode()

    async def run(self) -> None:
        """Deliver until cancelled; then deliver waiting messages for a bounded time, and publish `offline`."""
        async with asyncio.TaskGroup() as tasks:
            keepers = [tasks.create_task(self._sync_to_disk(store)) for store in self._stores.both]
            delivery = tasks.create_task(self._deliver())
            try:
                await asyncio.shield(delivery)
            except asyncio.CancelledError:
                self._stop.set()
                self._snapshots.arrived.set()
                self._others.arrived.set()
                if not self.connected:
                    delivery.cancel()
                with suppress(TimeoutError):
                    async with asyncio.timeout(STOP_TIMEOUT_S):
                        await delivery
                raise
            finally:
                for keeper in keepers:
                    keeper.cancel()

    async def _deliver(self) -> None:
        """Connect, and reconnect after each loss; return once stopped."""
        while not self._stop.is_set():
            self._connections += 1
            outboxes = (self._snapshots, self._others)
            self._connection = Connection(
                self._settings, self._root, outboxes, self, self._stop, protocol=self._protocol
            )
            try:
                await self._connection.run(self._on_connected, self._beat)
            except (MqttError, OSError) as error:  # OSError: the password file, the certificates
                if lacks_mqtt_5(error) and self._protocol is ProtocolVersion.V5:
                    self._protocol = ProtocolVersion.V311
                    continue
                self._beat()
                self._on_disconnected(await explain(error, self._settings))
                await self._pause(self._backoff.next())

    async def _pause(self, delay_s: float) -> None:
        end = time.monotonic() + delay_s
        while not self._stop.is_set() and (left := end - time.monotonic()) > 0:
            self._beat()
            with suppress(TimeoutError):
                async with asyncio.timeout(min(left, 0.5)):
                    await self._stop.wait()

    def _on_connected(self) -> None:
        self._up_since = time.monotonic()
        _log.info(
            "connected to the MQTT broker %s; %d messages are waiting", self._settings.address, self._stores.queued
        )

    def _on_disconnected(self, reason: str) -> None:
        """Log why there is no connection: as a warning once, for repeated attempts at debug level."""
        if self._up_since is not None and time.monotonic() - self._up_since > STABLE_CONNECTION_S:
            self._backoff.reset()
        self._up_since = None
        level = logging.DEBUG if reason == self._problem else logging.WARNING
        _log.log(level, "%s The daemon goes on, stores messages, and tries again.", reason)
        self._problem = reason

    def _log_once(self, problem: str) -> None:
        _log.log(logging.DEBUG if problem in self._logged else logging.WARNING, "%s", problem)
        self._logged.add(problem)

    async def _sync_to_disk(self, store: Spool) -> None:
        """Sync to the disk what has waited for a second; while the broker acknowledges in time, nothing is synced."""
        first = -1
        while True:
            waits = store.queued and store.first == first
            first = store.first
            if waits:
                # fsync blocks for as long as the disk takes: hence a thread, the only one here.
                try:
                    await asyncio.to_thread(store.begin_sync())
                except OSError as error:
                    self._log_once(f"the store could not be synced to the disk: {error}")
            await asyncio.sleep(DISK_SYNC_PERIOD_S)


_STORED = {channel.address.split("/", 1)[0]: channel.stored for channel in CHANNELS}
