"""A corrected delay of a state that changes: parameters that stand for a part of it are fitted with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from heated_room import ROWS, MEMORY_s, Room, STEP_s, response

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.delayed import shifted

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.data.recording import Recording

DELAY_s = 1800.0
CORRECTED = Contribution(
    "sensor-delay", {"late": "room_degC", "secant_s": DELAY_s, "passed": 1.0}, (DELAY_s,), (1,), relative_std=0.06
)


def _recording(delay_s: float) -> Recording:
    """Return two days of a room whose thermometer is late."""
    random = np.random.default_rng(5)
    current = np.repeat(random.uniform(8, 20, ROWS // 50), 50)
    columns = {"t_s": STEP_s * np.arange(ROWS), "heater_A": current, "wind_m_s": np.full(ROWS, 3.0)}
    true = response(current, {"warmth_K_A2": 0.04, "memory_s": MEMORY_s - 150.0})
    late = shifted(from_columns({**columns, "room_degC": true}), true[:, None], -delay_s)[:, 0]
    return from_columns({**columns, "room_degC": late + 0.5 * random.normal(size=ROWS)})


@pytest.mark.parametrize("now_s", [0.0, 500.0, 3000.0])
def test_a_corrected_delay_is_what_it_has_become(now_s: float) -> None:
    """Half an hour, half of the room's memory; gone, less, and more."""
    answer = compare(_recording(now_s), Room(), effects=[CORRECTED]).answer
    (change,) = answer.changes
    assert (answer.verdict, change.name) == ("missing-physics", "sensor-delay")
    assert change.low <= now_s <= change.high
    assert change.now == pytest.approx(now_s, abs=30)
    (memory,) = (each for each in answer.parameters if each.name == "memory_s")
    assert memory.low <= MEMORY_s - 150.0 <= memory.high


def test_a_corrected_delay_that_stays_is_consistent() -> None:
    """The room's memory is half a deviation off."""
    assert compare(_recording(DELAY_s), Room(), effects=[CORRECTED]).answer.verdict == "consistent"
