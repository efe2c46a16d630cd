"""Whitening: an autoregression of the noise, and what it leaves of any course of readings.

Noise with a memory hides what changes slowly, and hardly hides what changes quickly. A sum of squares over readings
that are whitened by an autoregression of the noise weighs each frequency by the noise there (generalised least squares;
Aitken, 1935). The correlation that is left goes into the long-run variance of the whitened readings (prewhitening;
Andrews and Monahan, 1992).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SINGLE_LAGS, LONGEST = 8, 128
"""Readings before, each with a coefficient of its own; and the furthest one. Those between share one in each octave: a
long memory is many small correlations, of which none is significant alone (after Corsi, 2009)."""
SHORTEST_BLOCK = 32
"""Readings that are filtered at once, at least (a choice: shorter ones are no quicker)."""
LEAST_READINGS_PER_LAG = 20
"""Readings for each lag of the autoregression (a choice)."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """An autoregression of noise: readings less what the readings before them let expect.

    Attributes
    ----------
    coefficients: of the readings before, the last one first, shape (order,)
    beginning: factors of the first readings of a run, which have fewer before them and vary more, shape (order,)
    """

    coefficients: Array
    beginning: Array

    def apply(self, values: NDArray[Any], runs: Sequence[slice]) -> NDArray[Any]:
        """Return readings of shape (…, reading), whitened along the last axis, each run for itself."""
        order, count = len(self.coefficients), values.shape[-1]
        if not values.size:
            return values
        block = self._block
        blocks = -(-(count + order * len(runs)) // block)
        # With so many zeros between the runs, one convolution serves all of them.
        places = [slice(run.start + order * k, run.stop + order * k) for k, run in enumerate(runs)]
        apart = np.zeros((*values.shape[:-1], blocks * block), values.dtype)
        for run, place in zip(runs, places, strict=True):
            apart[..., place] = values[..., run]
        convolved = self._convolved(apart.reshape(-1, blocks, block)).reshape(apart.shape)
        white = np.empty_like(values)
        for run, place in zip(runs, places, strict=True):
            white[..., run] = convolved[..., place]
            white[..., run][..., :order] *= self.beginning[: run.stop - run.start].astype(values.dtype)
        return white

    def _convolved(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return rows of blocks (row, block, reading), filtered from block to block: two products of matrices.

        A block is at least as long as the order, so that a reading depends on its own block and the one before.
        """
        within, after = self._matrices
        found = values @ within.astype(values.dtype)
        found[:, 1:] += values[:, :-1] @ after.astype(values.dtype)
        return np.asarray(found)

    @cached_property
    def _matrices(self) -> tuple[Array, Array]:
        """What a block's readings add to themselves, and to those of the block after it."""
        block = self._block
        response = np.zeros(2 * block)
        response[: len(self.coefficients) + 1] = np.append(1.0, -self.coefficients)
        lags = np.arange(block) - np.arange(block)[:, None]
        return np.where(lags >= 0, response[lags], 0), response[lags + block]

    @property
    def _block(self) -> int:
        """How many readings are filtered at once."""
        return max(len(self.coefficients), SHORTEST_BLOCK)


NOT_WHITENED = Whitening(np.zeros(0), np.zeros(0))
"""Leaves readings as they are."""


def estimate_whitening(
    courses: Sequence[tuple[Array, Sequence[slice]]], thresholds: Thresholds = THRESHOLDS
) -> Whitening:
    """Estimate an autoregression from courses of readings, each with its runs, scaled alike; its order by Akaike's AIC.

    Readings follow each other as they were read: of a sensor that is read in every tenth row, ten rows apart.
    """
    count = sum(len(values) for values, _ in courses)
    highest = int(min(LONGEST, count // LEAST_READINGS_PER_LAG))
    covariance = np.zeros(highest + 1)
    for values, runs in courses:
        for run in runs:
            part = values[run]
            for lag in range(min(highest + 1, len(part))):
                covariance[lag] += part[: len(part) - lag] @ part[lag:]
    if not covariance[0] > 0:
        return NOT_WHITENED
    correlation = covariance / covariance[0] / (1 + thresholds.least_white)
    correlation[0] = 1.0
    fits = [_fitted(correlation, groups) for groups in _nested(highest)]
    criterion = [count * np.log(variance) + 2 * groups for groups, (_, variance) in enumerate(fits)]
    coefficients, variance = fits[int(np.argmin(criterion))]
    return Whitening(coefficients, np.sqrt(variance / _beginning_variances(coefficients, correlation)))


def _nested(highest: int) -> Iterator[Array]:
    """Yield groups of lags that share a coefficient, none first, then one more each, shape (lag, group)."""
    ends = [*range(min(SINGLE_LAGS, highest) + 1)]
    while 2 * ends[-1] <= highest and ends[-1]:
        ends.append(2 * ends[-1])
    for count, longest in enumerate(ends):
        groups = np.zeros((longest, count))
        for group, (first, last) in enumerate(pairwise(ends[: count + 1])):
            groups[first:last, group] = 1.0
        yield groups


def _fitted(correlation: Array, groups: Array) -> tuple[Array, float]:
    """Return the coefficient of each lag, and the variance of what is left."""
    lags, own = len(groups), correlation[1 : len(groups) + 1]
    matrix = correlation[np.abs(np.subtract.outer(np.arange(lags), np.arange(lags)))]
    coefficients = groups @ np.linalg.solve(groups.T @ matrix @ groups, groups.T @ own)
    return coefficients, float(1 - 2 * own @ coefficients + coefficients @ matrix @ coefficients)


def _beginning_variances(coefficients: Array, correlation: Array) -> Array:
    """Return the variance that the filter leaves of each reading that has fewer readings before it than the order."""
    filtered = np.append(1.0, -coefficients)
    lags = np.abs(np.subtract.outer(np.arange(len(filtered)), np.arange(len(filtered))))
    matrix = correlation[: len(filtered)][lags]
    return np.array([filtered[:k] @ matrix[:k, :k] @ filtered[:k] for k in range(1, len(filtered))])
