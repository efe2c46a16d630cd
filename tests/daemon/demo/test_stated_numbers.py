"""The demo: its story, its rates, and what the screen shows.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "story": {
        "SPEED_M_S": 0.022,
        "STEADY_S": 150,
        "LIVE_S": 44,
        "BEFORE_BORDER_S": 4,
        "CONCEALED_A_S_PER_RAD": 4e-5,
    },
    "run": {"RATE_HZ": 4, "BOOT_S": 2, "WINDOW_S": 8},
    "screen": {"PLAIN_EVERY_S": 10},
    "comparison": {"SOIL_STD": 0.03},
    "live_table": {"HISTORY": 12, "ALARM_WIDTH": 80},
    "interval_bar": {"WIDTH": 34},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.demo", NUMBERS) == {}
