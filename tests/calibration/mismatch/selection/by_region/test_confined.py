"""Whole comparisons of an axis of which a law acts in a range of the temperature, or everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from lifting_axis import LiftingAxis, drive

from regolithd.calibration.mismatch import compare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def viscous_in_the_cold(columns: dict[str, Array]) -> Array:
    """Return a drag that grows with speed, below 14 °C alone."""
    return np.where(columns["oil_degC"] < 14.0, 0.35 * columns["speed_rad_s"], 0.0)


def grease(columns: dict[str, Array]) -> Array:
    """Return the drag of a grease that thickens by e each 12 K."""
    return 0.25 * np.sign(columns["speed_rad_s"]) * np.exp(-(columns["oil_degC"] - 20) / 12)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_law_below_a_temperature_is_told_by_it_and_gets_no_name(seed: int) -> None:
    """Friction of a cold lubricant, which holds at every temperature, would be near; the note says which law it is."""
    answer = compare(drive(seed, viscous_in_the_cold), LiftingAxis()).answer
    assert answer.verdict == "unexplained"
    assert answer.effects == ()
    (left,) = answer.unexplained
    assert left.covariate == "temperature"
    assert left.range is not None
    assert left.range.lower is None
    assert left.range.upper is not None
    assert left.range.upper.low < 14.0 < left.range.upper.high
    (note,) = (each for each in answer.notes if "the library's laws" in each)
    assert "viscous friction explains best what acts only below" in note
    assert "90 %" not in note


@pytest.mark.parametrize("seed", [1, 2])
def test_a_law_that_holds_everywhere_keeps_its_name(seed: int) -> None:
    """A cold lubricant is one at every temperature."""
    answer = compare(drive(seed, grease), LiftingAxis()).answer
    assert [effect.name for effect in answer.effects] == ["cold-lubricant-friction"]
    assert answer.unexplained == ()
