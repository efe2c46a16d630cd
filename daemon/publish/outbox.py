"""What is to be published, before there is a connection: the store, the newest live messages, the current states.

Filling it never waits and never fails, whatever the broker does. One task fills it, one empties it, in one event loop.
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

    from regolithd.daemon.publish.segment import Record
    from regolithd.daemon.publish.spool import Spool

LIVE_WITHIN_NS = 1_000_000_000
"""A stored message that is sent within a second of being stored is not late."""

_RETAINED = frozenset(channel.address.split("/")[0] for channel in CHANNELS if channel.retain)


def is_retained(topic: str) -> bool:
    """Whether the broker is to keep the last message of this topic (below `<prefix>/<rover>/`)."""
    return topic.split("/", 1)[0] in _RETAINED


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """A message on its way; `index` is its place in the store."""

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
    """Everything that waits. `arrived` is set whenever something new does."""

    spool: Spool
    arrived: asyncio.Event = field(default_factory=asyncio.Event)
    live_arrived: asyncio.Event = field(default_factory=asyncio.Event)
    repeated: int = 0
    _live: dict[str, bytes] = field(default_factory=dict)
    _current: dict[str, tuple[int, bytes]] = field(default_factory=dict)  # retained topics: newest index and payload
    _position: int = 0  # the next index to send
    _sent_to: int = 0  # behind the last index that was ever sent by this process
    _live_from: int = 0  # what was stored before this connection is late
    _flights: deque[_Flight] = field(default_factory=deque)

    def store(self, topic: str, payload: bytes) -> None:
        """Take a message that must not be lost."""
        index = self.spool.append(topic, payload)
        if is_retained(topic):
            self._current[topic] = (index, payload)
        self.arrived.set()

    def show(self, messages: dict[str, bytes]) -> None:
        """Take live messages; one that is still waiting on the same topic is replaced."""
        self._live |= messages
        self.live_arrived.set()

    def take_live(self) -> dict[str, bytes]:
        """Return the live messages, and forget them."""
        taken, self._live = self._live, {}
        self.live_arrived.clear()
        return taken

    def connected(self) -> dict[str, bytes]:
        """Begin a connection: what was sent and not acknowledged is sent again, late.

        Returns the retained messages that the broker had acknowledged before, topic → payload. It may have lost them in
        a restart; they are no news, so they are marked late as well.
        """
        self._position = self.spool.first
        self._live_from = self.spool.next
        self._flights.clear()
        self._live.clear()
        return {topic: as_late(payload) for topic, (index, payload) in self._current.items() if index < self._position}

    def waiting(self) -> Iterator[OutgoingMessage]:
        """Yield what is to be sent next, in order, as long as something is at hand. Each must be taken by `sent`.

        Whether one is late is decided when it is asked for: the one before may have waited long for its turn.
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
        """Note that this one is on its way."""
        self.repeated += message.index < self._sent_to
        self._position = message.index + 1
        self._sent_to = max(self._sent_to, self._position)
        self._flights.append(_Flight(message.index))

    def acknowledged(self, message: OutgoingMessage) -> None:
        """Note that the broker has it. The store forgets it once it has everything before it as well."""
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
        """How many are on their way."""
        return len(self._flights)
