"""Server-sent events: what is sent, and what happens with a page that does not read."""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from ground_messages import received

from regolithd.daemon.ground.live import WAITING_UPDATES, Live
from regolithd.daemon.ground.store.messages import Stored

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    import pytest

JOURNAL: Any = SimpleNamespace(reports=lambda _rover, _now: [])


async def first(updates: AsyncIterator[bytes]) -> dict[str, Any]:
    """Return the next update."""
    line = await anext(updates)
    content: dict[str, Any] = json.loads(line.removeprefix(b"data: "))
    return content


async def test_a_change_is_sent_once_and_a_repetition_not() -> None:
    """Live numbers are appended, late ones are announced, and what was stored before changes nothing."""
    live = Live(JOURNAL, lambda: "", lambda: 5_000_000)
    updates = live.updates()
    assert await anext(updates) == b"retry: 2000\n\n"
    live.take(Stored(received("posterior", 1), new=True, newest=True))
    live.take(Stored(received("posterior", 0, late=True), new=True, newest=False))
    live.take(Stored(received("posterior", 1, late=True), new=False, newest=False))
    live._send_changes()
    update = (await first(updates))["rovers"]["kapvik"]
    assert list(update["latest"]) == ["posterior"]
    assert len(update["points"]["posterior"]) == 1
    assert update["backfilled"]
    live._send_changes()
    live.close()
    assert [line async for line in updates] == []


async def test_numbers_on_time_and_late_ones_are_told_apart() -> None:
    """Those on time are points to append; after late ones a page reads its curves again."""
    live = Live(JOURNAL, lambda: "", lambda: 5_000_000)
    updates = live.updates()
    await anext(updates)
    live.take(Stored(received("posterior", 1), new=True, newest=True))
    live._send_changes()
    on_time = (await first(updates))["rovers"]["kapvik"]
    live.take(Stored(received("posterior", 0, late=True), new=True, newest=False))
    live._send_changes()
    late = (await first(updates))["rovers"]["kapvik"]
    assert (len(on_time["points"]["posterior"]), on_time["backfilled"]) == (1, False)
    assert (late["points"], late["backfilled"]) == ({}, True)
    await updates.aclose()


async def test_a_page_hears_the_time_where_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that it can tell a quiet rover from a lost connection."""
    monkeypatch.setattr("regolithd.daemon.ground.live.KEEP_ALIVE_S", 0.01)
    updates = Live(JOURNAL, lambda: "", lambda: 5_000_000).updates()
    await anext(updates)
    assert [await first(updates), await first(updates)] == [{"now_ms": 5.0, "rovers": {}}] * 2
    await updates.aclose()


async def test_a_page_that_does_not_read_is_told_to_read_everything_again() -> None:
    """The updates that wait for it do not grow without limit."""
    live = Live(JOURNAL, lambda: "", lambda: 5_000_000)
    updates = live.updates()
    await anext(updates)
    waiting = asyncio.ensure_future(anext(updates))
    await asyncio.sleep(0)
    for number in range(2 * WAITING_UPDATES):
        live.take(Stored(received("event", number), new=True, newest=True))
        live._send_changes()
    assert (await waiting).startswith(b"event: reload")
    assert len(live._pages) == 1
    (page,) = live._pages
    assert page.qsize() <= WAITING_UPDATES
    await updates.aclose()
    assert not live._pages
