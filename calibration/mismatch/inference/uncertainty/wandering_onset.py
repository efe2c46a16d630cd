"""The onset of an effect that wanders: how likely the readings are if a Brownian motion begins at each onset.

After its onset the effect is one of the candidate's developments g with a Brownian motion W beside it, S (z g + r W):
a random walk with a rate, the usual model of a sensor's drift (IEEE Std 952). W has the variance 1 at the end of the
recording, z is standard normal; development, r and S are unknown and summed over.

Both are taken as straight between the onsets of the grid: sums of increments, each with a column that rises from 0 to 1
between two of them. The columns' moments m and products C beside the other terms are computed once, and an onset takes
those after it. With all increments over the standard deviations of those of W, and b those of g, the readings are more
likely than without the effect by a factor whose logarithm is half of (Rasmussen and Williams, 2006, section 2.7)

q mᵀ K m + ln det K + S² (bᵀ K m)² / (1 + S² bᵀ K C b) − ln (1 + S² bᵀ K C b), K = (1 + q C)⁻¹, q = S² r².
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import late_with

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.selection.shape_optimisation import ShapeProfile

Array = NDArray[np.float64]

OVERCONFIDENCE = 2.0
"""Factor by which m and C are too large: the noise and its memory are estimated from the same readings. Found in 424
recordings with six kinds of drift, under noise with and without memory: 1 and 1.5 place random walks best, but ramps
under noise with memory worse in the mean than developments alone do; 2 does not."""
WANDERED = (0.1, 0.3, 1.0)
"""What the effect has wandered by the end of the recording, as shares of its size: r (a choice: from hardly to wholly;
0.3 alone places onsets equally well)."""
SIZES = (0.1, 0.32, 1.0, 3.2, 10.0)
"""Standard deviations S of the effect, as shares of its fitted coefficient (a choice: even in the logarithm, and wide
enough for an onset that asks for a much larger effect; a range ten times as wide changes nothing)."""


def likelihood(profile: ShapeProfile, onsets_s: Array, developments: Sequence[Shape], size: float) -> Array:
    """Return the likelihood of each onset of a grid, with a constant factor, shape (onset,).

    `size` is the coefficient that was fitted. The candidate has one column, which is the same on all wheels.
    """
    problem, candidate = profile.equations.problem, profile.candidate
    times_s = np.append(onsets_s, problem.length_s)
    # One by one: long recordings have no room for all of them in double precision.
    increments = (late_with(problem, candidate, _increment(problem, *ends)) for ends in pairwise(times_s))
    moment, products, _ = profile.sums(np.concatenate([profile.rows(columns) for columns in increments]))
    found = []
    for first, onset_s in enumerate(onsets_s):
        shapes = [{**development, candidate.change_point: float(onset_s)} for development in developments]
        grown = [candidate.columns(problem, shape)[0, :, 0] for shape in shapes]
        steps = np.diff([np.interp(times_s[first:], problem.time_s[:, 0], path) for path in grown], axis=1)
        deviation = np.sqrt(np.diff(times_s[first:]) / (problem.length_s - onset_s))
        within = products[first:, first:] * np.outer(deviation, deviation)
        known = moment[first:] * deviation / OVERCONFIDENCE, within / OVERCONFIDENCE
        found.append(_logarithms(*known, steps / deviation, size))
    return np.asarray(np.exp(np.array(found) - np.max(found)).sum(axis=(1, 2, 3)))


def _increment(problem: Problem, begin_s: float, end_s: float) -> Array:
    """Return a column that rises from 0 to 1 between two times, shape (1, time, wheel)."""
    risen = np.clip((problem.time_s - begin_s) / (end_s - begin_s), 0.0, 1.0)
    return np.broadcast_to(risen, problem.mask.shape)[None]


def _logarithms(moment: Array, products: Array, steps: Array, size: float) -> Array:
    """Return the logarithm of the likelihood for each S, r and development, of `steps` (development, increment)."""
    values, vectors = np.linalg.eigh(products)
    values, along, steps = np.maximum(values, 0.0), moment @ vectors, steps @ vectors
    variance = (size * np.array(SIZES)[:, None, None]) ** 2
    walk = variance * np.array(WANDERED)[:, None] ** 2
    left = 1 / (1 + walk * values)
    of_walk = (walk * left * along**2 + np.log(left)).sum(axis=-1, keepdims=True)
    energy, share = (left * values) @ (steps**2).T, (left * along) @ steps.T
    gained = variance * energy
    return np.asarray(0.5 * (of_walk + variance * share**2 / (1 + gained) - np.log1p(gained)))
