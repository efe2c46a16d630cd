"""What the page shows now, and the changes that are sent to it: server-sent events, four a second at most.

{"now_ms": …, "broker": "", "rovers": {"kapvik": {
    "latest": {"snapshot": {…}, "node/3": {…}},     newest message of each topic that changed
    "points": {"snapshot": [[time_ms, values…]]},   numbers to append to the plots
    "alarms": […],                                  all alarms, if any changed
    "received_ms": …, "data_ms": …,                 when the last message came, and its own time
    "backfilled": true}}}                           late messages came: the plots are to be read again
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pydantic_core import to_json

from regolithd.daemon.ground.store.series import SERIES

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from regolithd.daemon.ground.alarms.journal import AlarmJournal
    from regolithd.daemon.ground.received import Received
    from regolithd.daemon.ground.store.messages import Stored

PERIOD_S = 0.25
WAITING_UPDATES = 40
"""Updates that wait for a slow page; then it is told to read everything again."""
KEEP_ALIVE_S = 5.0


@dataclass(slots=True)
class _Changes:
    """What changed of one rover since the last update."""

    latest: dict[str, dict[str, Any]] = field(default_factory=dict)
    points: dict[str, list[list[float]]] = field(default_factory=lambda: defaultdict(list))
    log: bool = False
    alarms: bool = False
    backfilled: bool = False
    data_ms: float = 0.0

    def take(self, message: Received, *, newest: bool) -> None:
        """Note a message."""
        if newest:
            self.latest[message.topic] = message.content
        if message.late:
            self.backfilled |= message.channel in SERIES
        elif message.channel in SERIES:
            row = [message.time_ns / 1e6, *SERIES[message.channel].values(message.content)]
            self.points[message.channel].append(row)
            self.data_ms = max(self.data_ms, row[0])
        self.log |= message.channel in {"event", "emcy", "alarm", "state"}


class Live:
    """Collects changes and sends them to every page that is open."""

    def __init__(self, journal: AlarmJournal, problem: Callable[[], str], clock_ns: Callable[[], int]) -> None:
        self._journal = journal
        self._problem = problem
        self._clock_ns = clock_ns
        self._changes: defaultdict[str, _Changes] = defaultdict(_Changes)
        self._pages: set[asyncio.Queue[bytes | None]] = set()
        self._shelved_until_ns = 0
        self._told_problem = ""
        self.health: dict[str, dict[str, Any]] = {}
        self.received_ms: dict[str, float] = {}
        self.data_ms: dict[str, float] = {}

    def take(self, stored: Stored) -> None:
        """Note a message that was stored; one that was stored before changes nothing."""
        self._note(stored.message)
        if stored.new or stored.newest:
            self._changes[stored.message.rover].take(stored.message, newest=stored.newest)

    def take_health(self, message: Received) -> None:
        """Note a health message, which is not stored."""
        self._note(message)
        self.health[message.rover] = message.content
        self._changes[message.rover].latest[message.topic] = message.content

    def _note(self, message: Received) -> None:
        self.received_ms[message.rover] = self._clock_ns() / 1e6
        data_ms = message.time_ns / 1e6
        if message.channel in SERIES or message.channel == "health":
            self.data_ms[message.rover] = max(data_ms, self.data_ms.get(message.rover, 0.0))

    def alarms_changed(self, rover: str) -> None:
        """Note that an alarm's state changed."""
        self._changes[rover].alarms = self._changes[rover].log = True

    async def run(self) -> None:
        """Send updates until cancelled; then end every page's stream."""
        try:
            while True:
                await asyncio.sleep(PERIOD_S)
                self._send_changes()
        finally:
            self.close()

    def close(self) -> None:
        """End every page's stream, so that the server can stop."""
        for page in self._pages:
            _put(page, None)

    def _send_changes(self) -> None:
        problem = self._problem()
        if not self._changes and problem == self._told_problem:
            return
        changes, self._changes = self._changes, defaultdict(_Changes)
        self._told_problem = problem
        if self._pages:
            rovers = {rover: self._content(rover, changed) for rover, changed in changes.items()}
            self._send({"now_ms": self._clock_ns() / 1e6, "broker": problem, "rovers": rovers})

    def _content(self, rover: str, changed: _Changes) -> dict[str, Any]:
        content = {
            "latest": changed.latest,
            "points": changed.points,
            "log": changed.log,
            "backfilled": changed.backfilled,
            "received_ms": self.received_ms.get(rover),
            "data_ms": self.data_ms.get(rover),
        }
        return content | ({"alarms": self._journal.reports(rover, self._clock_ns())} if changed.alarms else {})

    def _send(self, update: dict[str, Any]) -> None:
        line = b"data: " + to_json(update, inf_nan_mode="null") + b"\n\n"
        for page in self._pages:
            _put(page, line)

    async def updates(self) -> AsyncIterator[bytes]:
        """Yield server-sent events for one page, until the ground stops."""
        page: asyncio.Queue[bytes | None] = asyncio.Queue(WAITING_UPDATES)
        self._pages.add(page)
        try:
            yield b"retry: 2000\n\n"
            while True:
                try:
                    async with asyncio.timeout(KEEP_ALIVE_S):
                        line = await page.get()
                except TimeoutError:
                    line = b"data: " + to_json({"now_ms": self._clock_ns() / 1e6, "rovers": {}}) + b"\n\n"
                if line is None:
                    return
                yield line
        finally:
            self._pages.discard(page)


def _put(page: asyncio.Queue[bytes | None], line: bytes | None) -> None:
    """Add a line; for a page that reads too slowly, replace all that wait by the demand to read everything again."""
    if page.full():
        while not page.empty():
            page.get_nowait()
        page.put_nowait(b"event: reload\ndata: {}\n\n")
    page.put_nowait(line)
