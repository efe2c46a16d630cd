"""The periodic timers: no drift and no bursts, with timerfd and with asyncio."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.drivers.canopen.timer import KernelTimer, LoopTimer, Schedule, Timer, periodic

START_NS = 100_000_000_000
PERIOD_NS = 5_000_000


@given(st.integers(5_000_000, 1_000_000_000), st.lists(st.integers(0, 3_000_000_000), max_size=60))
def test_a_schedule_neither_drifts_nor_bursts(period_ns: int, delays_ns: list[int]) -> None:
    """Every due time is start + n·period, and periods that have passed are skipped and counted."""
    schedule, now, counted = Schedule(START_NS, period_ns), START_NS, 0
    for delay in delays_ns:
        due, missed = schedule.following(now)
        counted += 1 + missed
        assert due == START_NS + counted * period_ns
        assert due > now - period_ns
        now = max(now, due) + delay


def test_each_due_time_is_later_than_the_one_before() -> None:
    """Asked early or at once, the next period; asked late, the period that is running, with those skipped before it."""
    schedule = Schedule(START_NS, 10)
    asked = {0: (10, 0), 3: (20, 0), 20: (30, 0), 31: (40, 0), 74: (70, 2), 70: (80, 0), 100: (100, 1)}
    for now, (due, missed) in asked.items():
        assert schedule.following(START_NS + now) == (START_NS + due, missed)


@pytest.mark.parametrize("kind", [LoopTimer, KernelTimer])
async def test_no_tick_is_early_and_missed_ones_are_counted(kind: type[Timer]) -> None:
    """Ticks and missed ticks add up to the time that has passed, and after a stall there is one tick, not a burst."""
    before_ns = time.monotonic_ns()
    timer = kind(PERIOD_NS)
    counted = 0
    for number in range(40):
        if number in (10, 20):
            time.sleep(0.042)  # noqa: ASYNC251  # blocks the event loop on purpose
        tick = await timer.tick()
        now_ns = time.monotonic_ns()
        counted += 1 + tick.missed
        assert tick.late_ns >= 0
        assert now_ns >= before_ns + counted * PERIOD_NS
        if number in (10, 20):
            assert tick.missed >= 7
    if isinstance(timer, KernelTimer):
        timer.close()


async def test_a_timer_closes_its_descriptor() -> None:
    """A hundred timers leave no open file descriptor."""
    for _ in range(100):
        with periodic(PERIOD_NS):
            pass
    with periodic(PERIOD_NS) as timer:
        assert (await timer.tick()).late_ns >= 0
