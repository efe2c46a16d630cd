"""Limits how many events of one kind and node are published: a token bucket for each, and a summary of the rest.

    throttle = EventThrottle()
    if throttle.admits(event, now_ns): publish(event)            # otherwise the event is withheld
    for event, count in throttle.summaries(): publish(event)     # once a second: the newest of `count` withheld events

The newest withheld event is always published, so that a subscriber knows the last state (an EMCY error reset, say).
While events of a kind and node are withheld, none of them is published before their summary: the order is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.drivers.master.events import NetworkEvent

BURST = 20
"""Events of one kind and node that are published at once; a drive that is enabled and disabled reports six."""

REFILL_PER_S = 2.0
"""Rate at which events of one kind and node are published for a long time, besides one summary a second."""

SUMMARISING_HOLD_NS = 10_000_000_000
"""How long `summarised` names a kind and node after its last withheld event, so that the alarm does not flicker."""


@dataclass(slots=True)
class _Bucket:
    filled_ns: int
    tokens: float = BURST
    withheld: int = 0
    newest: NetworkEvent | None = None
    withheld_ns: int | None = None

    def take(self, now_ns: int) -> bool:
        """Take a token if there is one."""
        self.tokens = min(BURST, self.tokens + (now_ns - self.filled_ns) / 1e9 * REFILL_PER_S)
        self.filled_ns = now_ns
        if self.tokens < 1.0:
            return False
        self.tokens -= 1.0
        return True


class EventThrottle:
    """The buckets of all kinds and nodes. Times are CLOCK_MONOTONIC [ns]."""

    def __init__(self) -> None:
        self._buckets: dict[tuple[type[NetworkEvent], int | None], _Bucket] = {}
        self.withheld = 0  # since the start

    def admits(self, event: NetworkEvent, now_ns: int) -> bool:
        """Return whether the event is to be published now; otherwise keep it for the next summary."""
        key = (type(event), getattr(event, "node_id", None))
        bucket = self._buckets.get(key)
        if bucket is None:
            bucket = self._buckets[key] = _Bucket(now_ns)
        if not bucket.withheld and bucket.take(now_ns):
            return True
        bucket.withheld += 1
        bucket.newest, bucket.withheld_ns = event, now_ns
        self.withheld += 1
        return False

    def summaries(self) -> list[tuple[NetworkEvent, int]]:
        """Return the newest withheld event of each kind and node, and how many there were since the last call."""
        found: list[tuple[NetworkEvent, int]] = []
        for bucket in self._buckets.values():
            if bucket.newest is not None:
                found.append((bucket.newest, bucket.withheld))
                bucket.withheld, bucket.newest = 0, None
        return sorted(found, key=lambda each: each[0].time_ns)

    def summarised(self, now_ns: int) -> tuple[tuple[type[NetworkEvent], int | None], ...]:
        """Return the kinds and nodes whose events are summarised at present."""
        return tuple(
            key
            for key, bucket in self._buckets.items()
            if bucket.withheld_ns is not None and now_ns - bucket.withheld_ns < SUMMARISING_HOLD_NS
        )
