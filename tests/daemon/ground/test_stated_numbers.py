"""The ground station: sessions, periods, limits and spans of averages.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from datetime import timedelta

from stated_numbers import differing

NUMBERS = {
    "subscription": {"BATCH": 20},
    "web.users": {"SHORTEST_PASSWORD": 10, "SESSION_S": timedelta(days=7).total_seconds()},
    "web.api": {"LOG_LINES": 200, "_LARGEST": 2**63 - 1},
    "web.reports": {"LARGEST": 20e6},
    "live": {"PERIOD_S": 0.25, "WAITING_UPDATES": 40, "KEEP_ALIVE_S": 5},
    "alarms.journal": {"LONGEST_SHELVING_S": timedelta(hours=8).total_seconds()},
    "ground": {"TRIM_PERIOD_S": 60, "TRIM_PAUSE_S": 0.05},
    "store.history": {"_NS": 1e9, "RAW_RATE_HZ": 10},
    "store.series": {"SPANS_S": (2, 15, 120, 900), "MOST_POINTS": 2500},
    "store.retention": {"BATCH": 2000, "_DAY_NS": timedelta(days=1).total_seconds() * 1e9},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.ground", NUMBERS) == {}
