"""Noise as an autoregression of first order, and what it says for or against a change of what is expected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

LEAST_VARIANCE = 1e-300
"""Variance of a recording without noise: any change is clear."""
FURTHEST = 5.0
"""Standard deviations beyond which what is left counts as so far (a choice: one outlier decides nothing)."""


@dataclass(frozen=True)
class FirstOrder:
    """Noise of which each reading has a share of the one before.

    Attributes
    ----------
    persistence: the share
    variance: of what is new in each reading
    """

    persistence: float
    variance: float

    @classmethod
    def of(cls, series: Sequence[Array]) -> FirstOrder:
        """Return that of series, each of shape (time, wheel), with NaN where nothing is known."""
        before = np.concatenate([each[:-1].ravel() for each in series])
        after = np.concatenate([each[1:].ravel() for each in series])
        known = np.isfinite(before) & np.isfinite(after)
        power = float(np.sum(before[known] ** 2))
        persistence = float(np.clip(before[known] @ after[known] / power, 0.0, 1.0)) if power > 0 else 0.0
        new = after[known] - persistence * before[known]
        return cls(persistence, max(robust_std(new) ** 2, LEAST_VARIANCE))

    def new(self, series: Array) -> Array:
        """Return what is new in each reading but the first, shape (time − 1, wheel)."""
        return series[1:] - self.persistence * series[:-1]

    def size(self, change: Array) -> float:
        """Return the sum of squares of a change (time, wheel) over the noise: Δχ² of one that is there."""
        return float(np.nansum(self.new(change) ** 2)) / self.variance

    def log_likelihood_ratio(self, change: Array, left: Array) -> float:
        """Return how much better `left`, (time, wheel), is explained with a change in it than without.

        Both are NaN where nothing is known.
        """
        change, left = self.new(change), self.new(left)
        without, beside = (np.minimum(each**2 / self.variance, FURTHEST**2) for each in (left, left - change))
        return 0.5 * float(np.nansum(without - beside))
