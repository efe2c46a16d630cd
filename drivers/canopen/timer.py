"""A periodic timer that does not drift: the n-th tick is due at start + n·period, however late earlier ticks were.

On Linux the kernel keeps the schedule (timerfd), and the event loop wakes up by a file descriptor: the median
tick is 0.1 ms late. asyncio's own timers have a resolution of 1 ms (epoll) and are 0.8 ms late in the median; they are
used on systems without timerfd.
"""

from __future__ import annotations

import asyncio
import ctypes
import math
import os
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

_CLOCK_MONOTONIC = 1
_TFD_NONBLOCK = 0o4000
_TFD_TIMER_ABSTIME = 1


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick: its lateness, and how many ticks before it were skipped because the program was late."""

    late_ns: int
    missed: int


class Timer(Protocol):
    """A periodic timer."""

    async def tick(self) -> Tick:
        """Wait for the next tick."""


@contextmanager
def periodic(period_ns: int) -> Iterator[Timer]:
    """Tick every `period_ns`, from one period after now."""
    if sys.platform != "linux":
        yield LoopTimer(period_ns)
        return
    timer = KernelTimer(period_ns)
    try:
        yield timer
    finally:
        timer.close()


class Schedule:
    """Due times of a periodic action on a monotonic clock [ns]; pure."""

    def __init__(self, start_ns: int, period_ns: int) -> None:
        self._start_ns = start_ns
        self._period_ns = period_ns
        self._number = 0

    def following(self, now_ns: int) -> tuple[int, int]:
        """Return the next due time, and how many were skipped because `now_ns` is past them."""
        self._number += 1
        missed = max(0, math.floor((now_ns - self._start_ns) / self._period_ns) - self._number)
        self._number += missed
        return self._start_ns + self._number * self._period_ns, missed


class LoopTimer:
    """A periodic timer by `asyncio.sleep`."""

    def __init__(self, period_ns: int) -> None:
        self._schedule = Schedule(time.monotonic_ns(), period_ns)

    async def tick(self) -> Tick:
        """Wait for the next tick."""
        due_ns, missed = self._schedule.following(time.monotonic_ns())
        await asyncio.sleep((due_ns - time.monotonic_ns()) / 1e9)
        return Tick(max(0, time.monotonic_ns() - due_ns), missed)


class _TimerSpec(ctypes.Structure):
    """`struct itimerspec`: interval, then first expiry."""

    _fields_ = (
        ("interval_s", ctypes.c_long),
        ("interval_ns", ctypes.c_long),
        ("first_s", ctypes.c_long),
        ("first_ns", ctypes.c_long),
    )


class KernelTimer:
    """A periodic timer by timerfd, which is in Python's `os` module from 3.13 on only."""

    def __init__(self, period_ns: int) -> None:
        library = ctypes.CDLL(None, use_errno=True)
        self._descriptor = _checked(library.timerfd_create(_CLOCK_MONOTONIC, _TFD_NONBLOCK))
        self._period_ns = period_ns
        self._due_ns = time.monotonic_ns()  # of the last tick
        spec = _TimerSpec(*divmod(period_ns, 10**9), *divmod(self._due_ns + period_ns, 10**9))
        _checked(library.timerfd_settime(self._descriptor, _TFD_TIMER_ABSTIME, ctypes.byref(spec), None))
        self._expired = asyncio.Event()
        self._count = 0
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._descriptor, self._take)

    async def tick(self) -> Tick:
        """Wait for the next tick."""
        await self._expired.wait()
        self._expired.clear()
        count, self._count = self._count, 0
        self._due_ns += count * self._period_ns
        return Tick(max(0, time.monotonic_ns() - self._due_ns), count - 1)

    def close(self) -> None:
        """Close the file descriptor."""
        self._loop.remove_reader(self._descriptor)
        os.close(self._descriptor)

    def _take(self) -> None:
        self._count += int.from_bytes(os.read(self._descriptor, 8), sys.byteorder)
        self._expired.set()


def _checked(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result
