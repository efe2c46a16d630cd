"""Times after which a rising count, a stuck sensor or a burst of events is told.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "rising_counts": {"PAUSE_NS": 5e9, "LASTING_NS": 10e9},
    "stuck_sensor": {"STUCK_NS": 5e9, "STUCK_SNAPSHOTS": 20, "CHANGING_WHEELS": 3},
    "event_throttle": {"BURST": 20, "REFILL_PER_S": 2, "SUMMARISING_HOLD_NS": 10e9},
    "prometheus": {"_MEGABYTE": 10**6},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.health", NUMBERS) == {}
