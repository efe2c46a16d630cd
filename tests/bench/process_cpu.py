"""The processor time of another process, to the nanosecond; /proc/PID/stat counts in steps of 10 ms."""

from __future__ import annotations

import time

_ALL_THREADS = 2
"""CPUCLOCK_SCHED of the kernel's include/linux/posix-timers.h; the clock of a process is (~pid << 3) | this."""


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has used, all its threads together."""
    return time.clock_gettime(~pid << 3 | _ALL_THREADS)
