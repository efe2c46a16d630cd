"""Whether the computer's clock is right, as far as the kernel knows, and stays so.

Every snapshot's time is the kernel's. `adjtimex(2)` says, without any privilege and whoever disciplines it (chrony,
timesyncd, PTP), whether the clock is synchronised and how large its error may be.
"""

from __future__ import annotations

import asyncio
import ctypes
import os
import time
from dataclasses import dataclass
from typing import ClassVar

from regolithd.daemon.check.finding import Finding, good, unknown, warning, wrong

WATCH_S = 1.0
SET_BY_HAND_NS = 50_000_000
"""No discipline slews this much in a second (500 ppm are 0.5 ms): the clock was set."""
NEVER_SET_BEFORE_S = 1_735_689_600  # 2025-01-01: a computer without a battery wakes up earlier than this
LARGE_ERROR_S = 0.1
_TIME_ERROR = 5  # return value: not synchronised
_CURE = "Set up time synchronisation: `apt install chrony`, or `timedatectl set-ntp true`."


class _Timex(ctypes.Structure):
    """struct timex of adjtimex(2), as far as it is read; the rest is room."""

    _fields_: ClassVar = [
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),  # µs
        ("esterror", ctypes.c_long),  # µs
        ("status", ctypes.c_int),
        ("rest", ctypes.c_char * 256),
    ]


@dataclass(frozen=True, slots=True)
class Discipline:
    """What the kernel says about its clock."""

    synchronised: bool
    largest_error_s: float


def kernel_discipline() -> Discipline | None:
    """Ask the kernel; None where it does not say."""
    timex = _Timex()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    except (AttributeError, OSError):
        return None
    if state < 0:
        return None
    return Discipline(state != _TIME_ERROR, timex.maxerror / 1e6)


def judge_clock(discipline: Discipline | None, jump_ns: int, now_s: float) -> Finding:
    """Return what the kernel's word, and what was watched, amount to."""
    if now_s < NEVER_SET_BEFORE_S:
        return wrong("clock", f"it says {time.strftime('%Y-%m-%d', time.gmtime(now_s))}: it was never set", _CURE)
    if abs(jump_ns) > SET_BY_HAND_NS:
        text = f"it jumped by {jump_ns / 1e9:+.3f} s within a second"
        return wrong("clock", text, "Something sets it by steps: let one service alone discipline it, by slewing.")
    if discipline is None:
        return unknown("clock", f"the kernel ({os.uname().sysname}) does not say whether it is synchronised")
    if not discipline.synchronised:
        return warning("clock", "it is not synchronised: times differ from other computers', and may jump later", _CURE)
    if discipline.largest_error_s > LARGE_ERROR_S:
        text = f"it is synchronised, but may be wrong by {discipline.largest_error_s:.3f} s"
        return warning("clock", text, "Wait for it to settle, or give it a nearer time server.")
    return good("clock", f"synchronised, within {1e3 * discipline.largest_error_s:.1f} ms")


async def check_clock() -> list[Finding]:
    """Watch the clock for a second, and ask the kernel."""
    before = time.time_ns() - time.monotonic_ns()
    await asyncio.sleep(WATCH_S)
    jump = time.time_ns() - time.monotonic_ns() - before
    return [judge_clock(kernel_discipline(), jump, time.time())]
