"""Reads a socket as soon as it is readable; while frames come in quick succession, once every `INTERVAL_S`.

A frame may come every 50 µs on a bus at 1 Mbit/s, and waking up costs several times as much as reading and decoding.
So the answers to a SYNC, and the frames of a busy bus, are left to gather in the kernel, which has stamped each with
its time, and are read in batches. A frame that comes alone is read at once. Network cards do the same (interrupt
moderation).
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

INTERVAL_S = 0.001
"""The resolution of the event loop's timers: it adds at most about as much to the time at which a frame is read."""


class ModeratedReader:
    """Calls `read` whenever the socket is readable, but in quick succession only every `INTERVAL_S`.

    Parameters
    ----------
    source
        A non-blocking socket.
    read
        Reads what waits; returns whether there was anything. It may call `stop`.
    """

    def __init__(self, source: socket.socket, read: Callable[[], bool]) -> None:
        self._loop = asyncio.get_running_loop()
        self._source = source
        self._read = read
        self._running = False
        self._last_s = -INTERVAL_S
        self._timer: asyncio.TimerHandle | None = None
        self.start()

    @property
    def running(self) -> bool:
        """Whether it reads, since `start` or the beginning."""
        return self._running

    def start(self) -> None:
        """Begin to read; again after `stop`."""
        if not self._running:
            self._running = True
            self._loop.add_reader(self._source, self._read_at_once)

    def stop(self) -> None:
        """Stop reading; before the socket is closed."""
        self._running = False
        self._loop.remove_reader(self._source)
        if self._timer is not None:
            self._timer.cancel()

    def _read_at_once(self) -> None:
        now_s = self._loop.time()
        in_succession = now_s - self._last_s < INTERVAL_S
        self._last_s = now_s
        self._read()
        if in_succession and self._running:
            self._loop.remove_reader(self._source)
            self._timer = self._loop.call_later(INTERVAL_S, self._read_gathered)

    def _read_gathered(self) -> None:
        found = self._read()
        if found and self._running:
            self._timer = self._loop.call_later(INTERVAL_S, self._read_gathered)
        elif self._running:
            self._loop.add_reader(self._source, self._read_at_once)
