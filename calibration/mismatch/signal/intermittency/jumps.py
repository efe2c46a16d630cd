"""Jumps of the level of a course: what begins or ends from one reading to the next, which Gaussian noise does not.

Noise of any spectrum has normal differences between the medians of the readings before and after an instant, however
slow it is; where something large comes and goes, a few of them are far out. Medians do not see single readings.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.means import running_mean
from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches
from regolithd.calibration.mismatch.signal.robust import robust_std
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NONE: Index = np.zeros(0, np.int64)
LENGTHS = (5, 9, 17)
"""Readings before and after an instant whose medians are compared (a choice: five medians outvote two readings)."""
BESIDE = 0.8
"""Share of the deviations of a jump from which on there is another one beside it (a choice: 5.6 of them)."""
FEWEST_LENGTHS = 20
"""Lengths that a course has at least, so that few of its differences are at its jumps (a choice)."""


def jumps(course: Array, breaks: Index = NONE, least: float = 0.0, thresholds: Thresholds = THRESHOLDS) -> Index:
    """Return the readings with which another level begins, in ascending order, where noise does not jump so by chance.

    Beside one that is no chance there are smaller ones.

    Parameters
    ----------
    course: shape (reading,)
    breaks: readings that do not follow the one before: slow noise may be another there
    least: size of a jump, beyond which it is one: readings that are rounded jump by what they are rounded to
    """
    found: dict[int, bool] = {}
    for length in LENGTHS:
        if len(course) < FEWEST_LENGTHS * length:
            break
        together = _together(len(course), length, breaks)
        if not (_deviates(running_mean(course, length), together) > BESIDE * thresholds.most_jump_deviates).any():
            continue  # medians take a hundred times as long
        medians = np.median(sliding_window_view(course, length), axis=-1)
        deviates = np.where(np.abs(medians[length:] - medians[:-length]) > least, _deviates(medians, together), 0.0)
        for first, end in stretches(deviates > BESIDE * thresholds.most_jump_deviates):
            jump = first + int(np.argmax(deviates[first:end])) + length
            near = [other for other in found if abs(jump - other) <= length]
            is_certain = bool(deviates[first:end].max() > thresholds.most_jump_deviates)
            found |= {place: found[place] or is_certain for place in near} or {jump: is_certain}
    return np.array(sorted(found) if any(found.values()) else [], np.int64)


def _together(count: int, length: int, breaks: Index) -> NDArray[np.bool_]:
    """Return at which readings so many before and after have no break between them, shape (count - 2 length + 1,)."""
    broken = np.zeros(count + 1, np.int64)
    broken[breaks] = 1
    total = np.cumsum(broken)
    first = np.arange(count - 2 * length + 1)
    return np.asarray(total[first + 2 * length - 1] == total[first])


def _deviates(centres: Array, compared: NDArray[np.bool_]) -> Array:
    """Return how far apart centres are of readings before and after, in standard deviations; 0 where not compared.

    A course that is coarser than its noise has no scatter, and is nowhere apart.
    """
    length = len(centres) - len(compared)
    steps = centres[length:] - centres[:-length]
    return np.where(compared, np.abs(steps) / (robust_std(steps[compared]) or np.inf), 0.0)


def levels(course: Array, at: Index) -> Array:
    """Return the mean of a course (reading,) between its jumps, of the same shape."""
    edges = [0, *at.tolist(), len(course)]
    return np.concatenate([np.full(end - first, course[first:end].mean()) for first, end in pairwise(edges)])
