"""The queue between the daemon and the connection: stored messages, newest live messages, current retained messages.

Adding to it never waits and never fails, whatever the broker does. One task adds, one sends, in the same event loop.

| a stored message that is sent | is sent | with the retain flag |
|---|---|---|
| first within `LIVE_WITHIN_NS`, in the connection in which it was stored | unchanged | of its channel |
| later, again, or in another connection | marked late | only if it is the newest of a retained topic |
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.publish.encode import as_late

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.daemon.publish.segment_record import Record
    from regolithd.daemon.publish.spool import Spool

LIVE_WITHIN_NS = 1_000_000_000
"""A stored message that is sent within this time is not late."""

_RETAINED = frozenset(channel.address.split("/")[0] for channel in CHANNELS if channel.retain)


def is_retained(topic: str) -> bool:
    """Return whether messages of this topic (below `<prefix>/<rover>/`) have the retain flag."""
    return topic.split("/", 1)[0] in _RETAINED


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """A stored message as it is to be sent; `index` is its place in the store."""

    index: int
    topic: str
    payload: bytes
    retain: bool
    late: bool


@dataclass(slots=True)
class _Flight:
    index: int
    acknowledged: bool = False


@dataclass(slots=True)
class Outbox:
    """All messages that wait. `arrived` is set when a stored message is added, `live_arrived` when a live one is."""

    spool: Spool
    arrived: asyncio.Event = field(default_factory=asyncio.Event)
    live_arrived: asyncio.Event = field(default_factory=asyncio.Event)
    repeated: int = 0
    _live: dict[str, bytes] = field(default_factory=dict)
    _current: dict[str, tuple[int, bytes]] = field(default_factory=dict)  # retained topics: newest index and payload
    _position: int = 0  # the next index to send
    _sent_to: int = 0  # one past the last index that this process has sent
    _live_from: int = 0  # indices below were stored before this connection: late
    _flights: deque[_Flight] = field(default_factory=deque)

    def store(self, topic: str, payload: bytes) -> None:
        """Add a message that is stored until it is acknowledged."""
        index = self.spool.append(topic, payload)
        if is_retained(topic):
            self._current[topic] = (index, payload)
        self.arrived.set()

    def add_live(self, messages: dict[str, bytes]) -> None:
        """Add live messages, topic → payload; each replaces one that still waits on the same topic."""
        self._live |= messages
        self.live_arrived.set()

    def take_live(self) -> dict[str, bytes]:
        """Return the live messages and remove them."""
        taken, self._live = self._live, {}
        self.live_arrived.clear()
        return taken

    def connected(self) -> dict[str, bytes]:
        """Begin a connection: messages that were sent and not acknowledged will be sent again, marked late.

        Returns the retained messages that the broker had acknowledged before, topic → payload, marked late: the broker
        may have lost them in a restart.
        """
        self._position = self.spool.first
        self._live_from = self.spool.next
        self._flights.clear()
        self._live.clear()
        return {topic: as_late(payload) for topic, (index, payload) in self._current.items() if index < self._position}

    def waiting(self) -> Iterator[OutgoingMessage]:
        """Yield the next messages to send, in order. Call `sent` for each.

        Whether a message is late is decided when it is yielded, since it may have waited for the ones before it.
        """
        self.arrived.clear()
        for record in self.spool.read(self._position):
            yield self._outgoing(record)

    def _outgoing(self, record: Record) -> OutgoingMessage:
        retained = is_retained(record.topic)
        current = retained and self._current.get(record.topic, (-1, b""))[0] == record.index
        late = self._is_late(record)
        return OutgoingMessage(
            record.index,
            record.topic,
            as_late(record.payload) if late else record.payload,
            retain=current or (retained and not late),
            late=late,
        )

    def _is_late(self, record: Record) -> bool:
        if record.stored_ns is None or record.index < self._live_from or record.index < self._sent_to:
            return True
        return time.monotonic_ns() - record.stored_ns > LIVE_WITHIN_NS

    def sent(self, message: OutgoingMessage) -> None:
        """Note that a message is sent and awaits its acknowledgement."""
        self.repeated += message.index < self._sent_to
        self._position = message.index + 1
        self._sent_to = max(self._sent_to, self._position)
        self._flights.append(_Flight(message.index))

    def acknowledged(self, message: OutgoingMessage) -> None:
        """Note an acknowledgement. The store deletes a message once all before it are acknowledged as well."""
        for flight in self._flights:
            if flight.index == message.index:
                flight.acknowledged = True
                break
        done = 0
        end = 0
        while self._flights and self._flights[0].acknowledged:
            end = self._flights.popleft().index + 1
            done += 1
        if done:
            self.spool.acknowledge(end, done)

    @property
    def in_flight(self) -> int:
        """Number of messages that await their acknowledgement."""
        return len(self._flights)
