"""The condition variable that is notified from ordinary calls."""

from __future__ import annotations

import asyncio

from regolithd.drivers.master.condition import Condition


async def test_a_wait_that_is_given_up_leaves_nothing_behind() -> None:
    """Months of waiting for a silent node fill no list; a wait that is fulfilled ends."""
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
