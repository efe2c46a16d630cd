"""Who has answered lately: each task beats, and the watchdog is fed only while all of them do."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class TaskLiveness:
    """The last beat of each task, by name.

    `expect` once what shall beat, and how long it may be silent; `beat` from the task itself, at each round of its
    loop; then `silent` names those that are overdue.
    """

    def __init__(self, monotonic_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._now = monotonic_ns
        self._last: dict[str, int] = {}
        self._patience: dict[str, int] = {}

    def expect(self, name: str, patience_s: float) -> None:
        """Begin to expect a task; it counts as having answered now."""
        self._patience[name] = int(patience_s * 1e9)
        self._last[name] = self._now()

    def beat(self, name: str) -> None:
        """Say that the task is alive."""
        self._last[name] = self._now()

    def ages_s(self) -> dict[str, float]:
        """Return how long ago each task answered [s]."""
        now = self._now()
        return {name: (now - last) / 1e9 for name, last in self._last.items()}

    def silent(self) -> list[str]:
        """Return the tasks that have not answered in time."""
        now = self._now()
        return [name for name, patience in self._patience.items() if now - self._last[name] > patience]
