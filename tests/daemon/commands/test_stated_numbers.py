"""Exit statuses of the commands (sysexits.h; 128 + SIGINT).

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

import os
import signal

from stated_numbers import differing

NUMBERS = {
    "compare": {"EXIT_DATA": os.EX_DATAERR, "EXIT_DAEMON": os.EX_UNAVAILABLE},
    "mismatch": {"EXIT_DATA": os.EX_DATAERR},
    "traverse": {"INTERRUPTED": 128 + signal.SIGINT},
    "demo": {"SETTLE_S": 4},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.commands", NUMBERS) == {}
