"""Task liveness: each task reports regularly that it runs; the watchdog is fed only while all tasks do."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class TaskLiveness:
    """The time of the last report of each task, by name.

    Call `expect` once for each task, with the longest time between its reports; call `beat` from the task itself, in
    each iteration of its loop. `overdue` returns the tasks whose last report is too old.
    """

    def __init__(self, monotonic_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._now = monotonic_ns
        self._last: dict[str, int] = {}
        self._timeout_ns: dict[str, int] = {}

    def expect(self, name: str, timeout_s: float) -> None:
        """Begin to monitor a task; it counts as having reported now."""
        self._timeout_ns[name] = int(timeout_s * 1e9)
        self._last[name] = self._now()

    def beat(self, name: str) -> None:
        """Report that a task runs."""
        self._last[name] = self._now()

    def ages_s(self) -> dict[str, float]:
        """Return the time since the last report of each task [s]."""
        now = self._now()
        return {name: (now - last) / 1e9 for name, last in self._last.items()}

    def overdue(self) -> list[str]:
        """Return the names of the tasks that have not reported in time."""
        now = self._now()
        return [name for name, timeout_ns in self._timeout_ns.items() if now - self._last[name] > timeout_ns]
