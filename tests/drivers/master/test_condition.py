"""The condition variable that is notified from ordinary calls."""

from __future__ import annotations

import asyncio

from regolithd.drivers.master.condition import Condition


async def test_a_timed_out_wait_is_removed() -> None:
    """Timed-out waits do not accumulate, and a wait whose condition holds ends."""
    watch, seen = Condition(), []
    for _ in range(50):
        assert not await watch.until(lambda: bool(seen), 0.001)
    assert watch._waiting == []
    waiting = asyncio.ensure_future(watch.until(lambda: bool(seen), 20.0))
    await asyncio.sleep(0)
    watch.notify()  # not yet true
    await asyncio.sleep(0)
    seen.append(1)
    watch.notify()
    assert await waiting
    assert watch._waiting == []
