"""Says which counts of errors keep rising: an error that lasts wants an alarm, a single one does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

PAUSE_NS = 5_000_000_000
"""A count that has not risen for this long has stopped."""

LASTING_NS = 10_000_000_000
"""A count that has risen for this long, without such a pause, lasts."""


@dataclass(slots=True)
class _Rise:
    count: int
    since_ns: int
    until_ns: int


class RisingCounts:
    """Takes the counts regularly, at least once in `PAUSE_NS`. Times are CLOCK_MONOTONIC [ns]."""

    def __init__(self) -> None:
        self._rises: dict[str, _Rise] = {}

    def step(self, counts: Mapping[str, int], now_ns: int) -> None:
        """Take the present counts, by name."""
        for name, count in counts.items():
            rise = self._rises.get(name)
            if rise is None or (count > rise.count and now_ns - rise.until_ns > PAUSE_NS):
                self._rises[name] = _Rise(count, now_ns, now_ns)
            elif count > rise.count:
                rise.count, rise.until_ns = count, now_ns

    def lasting(self, now_ns: int) -> tuple[str, ...]:
        """Return the names of the counts that have been rising for `LASTING_NS`, and have not stopped."""
        return tuple(
            name
            for name, rise in self._rises.items()
            if rise.until_ns - rise.since_ns >= LASTING_NS and now_ns - rise.until_ns <= PAUSE_NS
        )
