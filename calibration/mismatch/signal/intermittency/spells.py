"""When something comes and goes in a course of readings, and how much of the power it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.means import running_mean
from regolithd.calibration.mismatch.signal.intermittency.skewness import third_cumulant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.signal.intermittency.switching_mean import SwitchingMean

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


def switching_spells(course: Array, switching: SwitchingMean) -> Spells:
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


def skewed_spells(course: Array, lengths: Sequence[int]) -> Spells:
    """Return the spells in a course (time,) of which running means of these lengths are skewed, in ascending order.

    The longest means have the least noise, and show when it acts: a spell begins about in the middle of the first mean
    that has risen. The shortest lose least of a spell's height.
    """
    level, acting = _between_spells(_upwards(course, lengths[-1]))
    own = _upwards(course, lengths[0])
    about = own - _between_spells(own)[0]
    # Noise has as much power above its level as below.
    power = float(np.sum(about * np.abs(about))) / len(about)
    whole = float(np.mean(course**2)) + level**2
    middle = (lengths[-1] - 1) // 2
    share = float(np.clip(power / max(whole, 1e-300), 0.0, 1.0))
    return Spells(int(acting[0]) + middle, int(acting[-1]) + middle, share)


def levelled_spells(course: Array, jumps: NDArray[np.int64], levels: Array) -> Spells:
    """Return what is between the first and the last jump of a course, or after the only one; levels and it (reading,).

    `levels` are those between the jumps (`signal/intermittency/jumps.py`).
    """
    last = int(jumps[-1]) - 1 if len(jumps) > 1 else len(course) - 1
    return Spells(int(jumps[0]), last, float(np.var(levels)) / max(float(np.mean(course**2)), 1e-300))


def _upwards(course: Array, length: int) -> Array:
    """Return running means, of the sign in which they are skewed."""
    means = running_mean(course, length)
    return means * (1.0 if third_cumulant(means) >= 0 else -1.0)


def _between_spells(means: Array) -> tuple[float, NDArray[np.int64]]:
    """Return the level between spells, which add to it, and the indices of means in which they act.

    Noise is symmetric: what is further above the level than the lowest mean is below it is in a spell. What is not in
    a spell has the level as its median.
    """
    acting = np.zeros(len(means), bool)
    while True:
        level = float(np.median(means[~acting]))
        above = means > 2 * level - np.min(means)
        if not np.any(above & ~acting):
            return level, np.flatnonzero(acting if acting.any() else means == np.max(means))
        acting |= above
