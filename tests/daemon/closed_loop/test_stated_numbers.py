"""The closed-loop study: sizes of what is concealed, and the profile of the speed.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "case": {
        "NO_LOAD_A": 0.037,
        "VISCOUS_A_S_PER_RAD": 4e-5,
        "SIZE_SPREAD": 0.15,
        "STATED_STD": 0.03,
        "NO_LOAD_STD_A": 0.001,
        "STRETCH_M": 4.5,
    },
    "soil_estimates": {"NEGLIGIBLE_A": 1e-9},
    "speed_profile": {"SPEEDS_RAD_S": (0.10, 0.45), "LEG_S": (20, 50), "RAMP_S": 2},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.closed_loop", NUMBERS) == {}
