"""Modes, limits, times and exit statuses of the control socket.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

import os

from stated_numbers import differing

NUMBERS = {
    "socket": {"MODE": 0o660},
    "metrics": {"MODE": 0o666, "VALID_S": 1, "REQUEST_LIMIT": 8192, "MAX_CLIENTS": 8},
    "client": {"EX_UNAVAILABLE": os.EX_UNAVAILABLE, "EX_NOPERM": os.EX_NOPERM},
    "protocol": {"LINE_LIMIT": 2**16},
    "traverse": {"REPORT_PERIOD_S": 0.5},
    "wheel_motion": {
        "TOLERANCE": 0.2,
        "APPROACH": 0.05,
        "WINDOW_S": 1,
        "WINDOW_SNAPSHOTS": 3,
        "GAP_S": 2.5,
        "COMPLETE": 0.95,
        "UNSEEN": 0.9,
    },
    "server": {"RETRY_S": 5, "MAX_CLIENTS": 64, "_ACCEPTED_AT_A_TIME": 16, "_WAITING_IN_KERNEL": 128},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.control", NUMBERS) == {}
