"""Checks the computer's clock: whether it is synchronised, and does not jump.

Every snapshot has the kernel's time. `adjtimex(2)` tells, without privileges and for every time service (chrony,
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

OBSERVATION_S = 1.0
CLOCK_JUMP_NS = 50_000_000
"""No time service slews this much in a second (500 ppm are 0.5 ms): the clock was set."""
EARLIEST_PLAUSIBLE_S = 1_735_689_600  # 2025-01-01; a computer without a battery-backed clock starts earlier
LARGE_ERROR_S = 0.1
_TIME_ERROR = 5  # return value: not synchronised
_REMEDY = "Set up time synchronisation: `apt install chrony`, or `timedatectl set-ntp true`."


class _Timex(ctypes.Structure):
    """struct timex of adjtimex(2): the fields that are read, then padding."""

    _fields_: ClassVar = [
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),  # µs
        ("esterror", ctypes.c_long),  # µs
        ("status", ctypes.c_int),
        ("padding", ctypes.c_char * 256),
    ]


@dataclass(frozen=True, slots=True)
class ClockState:
    """The state of the kernel's clock."""

    synchronised: bool
    largest_error_s: float


def kernel_clock_state() -> ClockState | None:
    """Return the state of the kernel's clock; None where adjtimex(2) is not available."""
    timex = _Timex()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    except (AttributeError, OSError):
        return None
    if state < 0:
        return None
    return ClockState(state != _TIME_ERROR, timex.maxerror / 1e6)


def judge_clock(state: ClockState | None, jump_ns: int, now_s: float) -> Finding:
    """Judge the clock from the kernel's state, a jump during the observation, and its time."""
    if now_s < EARLIEST_PLAUSIBLE_S:
        return wrong("clock", f"the date is {time.strftime('%Y-%m-%d', time.gmtime(now_s))}: it was never set", _REMEDY)
    if abs(jump_ns) > CLOCK_JUMP_NS:
        text = f"it jumped by {jump_ns / 1e9:+.3f} s within a second"
        return wrong("clock", text, "Let only one service adjust it, and by slewing, not by steps.")
    if state is None:
        return unknown("clock", f"the kernel ({os.uname().sysname}) does not say whether it is synchronised")
    if not state.synchronised:
        return warning(
            "clock", "it is not synchronised: times differ from other computers', and may jump later", _REMEDY
        )
    if state.largest_error_s > LARGE_ERROR_S:
        text = f"it is synchronised, but may be wrong by {state.largest_error_s:.3f} s"
        return warning("clock", text, "Wait until it has converged, or use a nearer time server.")
    return good("clock", f"synchronised, within {1e3 * state.largest_error_s:.1f} ms")


async def check_clock() -> list[Finding]:
    """Observe the clock for a second, and ask the kernel."""
    before = time.time_ns() - time.monotonic_ns()
    await asyncio.sleep(OBSERVATION_S)
    jump = time.time_ns() - time.monotonic_ns() - before
    return [judge_clock(kernel_clock_state(), jump, time.time())]
