"""pytest plugin: skips a test after `FAST_S` seconds of CPU time, and writes outcome and time of each test as JSON.

CPU time, unlike time on the clock, does not depend on what else the machine does.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator
    from types import FrameType

FAST_S = 6.0
"""CPU time of a fast test, fixtures and coverage included."""
LONGEST_CLOCK_S, REPEATED_S = 60.0, 0.05
"""Time on the clock of a test that waits; period in which an exceeded limit is tried again."""
WRITTEN_TO = "FAST_TESTS"
"""Environment variable: path of the file that is written."""


def cpu_s() -> float:
    """Return the CPU time of this process and of those that it started and that ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


class FastTests:
    """Limits and measures the tests of one run."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._inside = False
        self._passed: dict[str, bool] = {}
        signal.signal(signal.SIGPROF, self._expired)
        signal.signal(signal.SIGALRM, self._expired)

    def _expired(self, _: int, frame: FrameType | None) -> None:
        """Skip the test, unless coverage is at work, which would leave its lock taken: then when the timer repeats."""
        if self._inside and not (frame and "/coverage/" in frame.f_code.co_filename):
            self._inside = False
            pytest.skip(f"more than {FAST_S:g} s of CPU time, or {LONGEST_CLOCK_S:g} s")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Measure a test."""
        cpu, clock = cpu_s(), time.monotonic()
        signal.setitimer(signal.ITIMER_PROF, FAST_S, REPEATED_S)
        signal.setitimer(signal.ITIMER_REAL, LONGEST_CLOCK_S, REPEATED_S)
        result = yield
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        used = cpu_s() - cpu
        fast = self._passed.get(item.nodeid, False) and used < FAST_S
        told = {"test": item.nodeid, "fast": fast, "cpu_s": used, "clock_s": time.monotonic() - clock}
        with self._path.open("a") as file:
            file.write(json.dumps(told) + "\n")
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self) -> Generator[None, Any, Any]:
        """Allow the limit to end fixtures."""
        yield from self._limited()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None, Any, Any]:
        """Allow the limit to end the test."""
        yield from self._limited()

    def _limited(self) -> Generator[None, Any, None]:
        self._inside = True
        try:
            yield
        finally:
            self._inside = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note whether every phase of a test passed."""
        self._passed[report.nodeid] = report.passed and self._passed.get(report.nodeid, True)


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugin where a path is given."""
    if path := os.environ.get(WRITTEN_TO):
        config.pluginmanager.register(FastTests(Path(path)))
