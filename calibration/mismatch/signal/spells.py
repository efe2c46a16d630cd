"""When something comes and goes that switches the mean of a course, and how much of the power it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.signal.switching_mean import SwitchingMean

Array = NDArray[np.float64]

MORE_PROBABLY_THAN_NOT = 0.5


@dataclass(frozen=True)
class Spells:
    """What comes and goes in a course of readings.

    Attributes
    ----------
    first, last: index of the first and the last reading of a spell
    share: of the power about the level between the spells
    """

    first: int
    last: int
    share: float


def spells_in(course: Array, switching: SwitchingMean) -> Spells:
    """Return the spells of a course (reading,) whose mean switches so."""
    probability = switching.acting(course)
    blocks = np.flatnonzero(probability > MORE_PROBABLY_THAN_NOT)
    if not blocks.size:
        blocks = np.array([np.argmax(probability)])
    between = float(np.mean(course)) - switching.amplitude * float(np.mean(probability))
    power = switching.amplitude**2 * float(np.mean(probability))
    whole = max(float(np.mean((course - between) ** 2)), 1e-300)
    last = (int(blocks[-1]) + 1) * switching.block - 1
    return Spells(int(blocks[0]) * switching.block, last, float(np.clip(power / whole, 0.0, 1.0)))
