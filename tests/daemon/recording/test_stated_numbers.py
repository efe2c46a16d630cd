"""Times and limits of the recorder, and the flag of error frames.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

import socket

from stated_numbers import differing

NUMBERS = {
    "recorder": {"FLUSH_S": 0.4, "RETRY_S": 10},
    "ring": {"MEGABYTE": 10**6, "RESERVE": 0.05, "LARGEST_SHARE": 0.1},
    "candump": {"ERROR_FLAG": socket.CAN_ERR_FLAG},
    "mcap_records": {"_LONGEST": 64e6, "_LONGEST_INCOMPLETE": 4e6},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.recording", NUMBERS) == {}
