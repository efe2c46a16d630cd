"""Windows and tolerances of the pipeline.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "snapshot": {"WHEELS": 6},
    "posterior": {"SLIP_STD_MEASURED": 0.005, "SLIP_STD_CONFIGURED": 0.03, "HISTORY": 400},
    "onnx_models": {"RADIUS_TOLERANCE": 0.02},
    "dead_reckoning": {"PERIOD_NS": 0.5e9, "LONGEST_STEP_S": 2, "STANDSTILL_M_S": 1e-4},
    "acquire": {
        "AWAITED_WINDOWS": 3,
        "AMBIGUITY_NS": 0.5e9,
        "DOUBT_WINDOWS": 4,
        "DUPLICATES": 2,
        "SYNCHRONOUS_WINDOW": 0.9,
    },
    "smooth": {"MIN_SPREAD": 0.02, "MAX_SAMPLES": 45},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.pipeline", NUMBERS) == {}
