"""The noise of a fleet's recordings: how long it lasts is told by all of them together.

One recording of a thousand readings tells its autocorrelation time to within a factor of two. Where it happens to be
told too short, each reading counts for too much, and what is left by chance looks like an effect of that recording.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.noise_models.noise import autocorrelation_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.fleet.work.sums import Sums

Array = NDArray[np.float64]


def with_common_noise(sums: Sequence[Sums], found: Sequence[Found]) -> list[Sums]:
    """Return the sums of recordings, none of whose noise lasts for less than what all tell together."""
    return [_weighted(*each) for each in zip(sums, _shares(found).tolist(), strict=True)]


def _shares(found: Sequence[Found]) -> Array:
    """Return each recording's own autocorrelation time over the one that it counts with, at most 1, (recording,).

    Recordings with the same step of time are judged together: the times are in readings.
    """
    own = np.array([float(np.mean(each.autocorrelation_times)) for each in found])
    steps = np.array([f"{each.step_s:.2g}" for each in found])
    times = own.copy()
    for step in np.unique(steps):
        alike = np.flatnonzero(steps == step)
        if len(alike) > 1:
            times[alike] = autocorrelation_times([found[i].lagged for i in alike])
    return np.minimum(own / times, 1.0)


def _weighted(sums: Sums, share: float) -> Sums:
    """Return sums with the weight of each reading times a share; at the frequencies of some laws noise is as before."""
    if share == 1:
        return sums
    reductions = np.where(sums.reductions > 1, sums.reductions / share, 1.0)
    return replace(sums, weights=share * sums.weights, blocks=share * sums.blocks, reductions=reductions)
