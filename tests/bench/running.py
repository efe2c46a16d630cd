"""A publisher, a subscription or anything else with `run`, as a task while a context lasts."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import AsyncIterator


class Runs(Protocol):
    """Something that works until it is cancelled."""

    async def run(self) -> None:
        """Work."""


@asynccontextmanager
async def running(task: Runs) -> AsyncIterator[None]:
    """Run it while the context lasts."""
    runs = asyncio.create_task(task.run())
    try:
        yield
    finally:
        runs.cancel()
        with suppress(asyncio.CancelledError):
            await runs
