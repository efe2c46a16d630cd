"""Limits of `regolithd check`, and numbers of Linux and of makers.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from datetime import UTC, datetime

from stated_numbers import differing

NUMBERS = {
    "clock": {
        "OBSERVATION_S": 1,
        "CLOCK_JUMP_NS": 0.05e9,
        "EARLIEST_PLAUSIBLE_S": datetime(2025, 1, 1, tzinfo=UTC).timestamp(),
        "LARGE_ERROR_S": 0.1,
        "_TIME_ERROR": 5,  # sys/timex.h
    },
    "bus": {"_UP": 1, "_HIGH_LOAD": 0.8},  # net/if.h: IFF_UP
    "scan": {"_MAXON": 0xFB, "_EPOS4": 1},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.check", NUMBERS) == {}
