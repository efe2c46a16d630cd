"""A condition variable that is notified from ordinary calls."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class Condition:
    """Wakes the waiting tasks whenever what they wait for may have changed.

    Like `asyncio.Condition`, but `notify` is an ordinary call, so that the reader of the bus can make it between two
    frames.
    """

    def __init__(self) -> None:
        self._waiting: list[asyncio.Future[None]] = []

    def notify(self) -> None:
        """Wake all waiting tasks, which then check what they wait for."""
        waiting, self._waiting = self._waiting, []
        for future in waiting:
            if not future.done():
                future.set_result(None)

    async def until(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Wait until `condition` holds; return False if it does not within the time."""
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    future = asyncio.get_running_loop().create_future()
                    self._waiting.append(future)
                    try:
                        await future
                    finally:
                        if (
                            future in self._waiting
                        ):  # timed out or cancelled: a silent node must not leave one each time
                            self._waiting.remove(future)
        except TimeoutError:
            return condition()
        return True
