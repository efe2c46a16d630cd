"""The density of a noisy column's true values, without a form: Kiefer and Wolfowitz's maximum likelihood.

Readings are true values with normal errors of a known deviation, so that their density is the truth's, blurred. The
truth's is estimated as weights on a grid, by expectation and maximisation over binned readings (Laird, 1978; Koenker
and Mizera, 2014): an atom where the truth stays at 0, a few where it has levels, many where it is continuous. Its cost
does not depend on how many readings there are, but for counting them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID_STEP = 1 / 3
"""Distance of the grid's values in standard errors: nearer ones are not told apart."""
BIN_STEP = 1 / 10
"""Width of the bins of readings in standard errors: what is lost in them is a thousandth of the error's variance."""
MOST_VALUES = 64
"""Values on the grid (a choice: the cost is in proportion)."""
MOST_BINS = 400
"""Bins of readings (a choice)."""
FINEST_SHARE = 1 / 4000
"""Narrowest bin as a share of the readings' range: a far outlier must not make millions of them."""
ROUNDS = 60
"""Rounds of expectation and maximisation (a choice): more of them sharpen atoms that the readings hardly show."""
LEAST_TOLD = 1e-9
"""What readings say beside a prior, as a share of what both say, at least: less is rounding."""
LEAST_WEIGHT = 1e-12
"""Weight of a value that the readings rule out."""
NEGLIGIBLE_WEIGHT = 1e-5
"""Weight below which a value is left out, once the density is found (a choice)."""
AT_ONCE = 4096
"""Instants whose posteriors are computed at once: some two megabytes."""
NEGLIGIBLE_EXPONENT = -50.0
"""Logarithm of a likelihood beside the greatest, below which it is cut off: nothing is impossible, or subnormal."""


@dataclass(frozen=True, eq=False)
class MixingDensity:
    """Weights of a truth's values.

    Attributes
    ----------
    at: the values, ascending, shape (value,)
    weight: their shares, above 0, which sum to 1, shape (value,)
    spread: variance of the truth about each value, 0 of a value on the fine grid, shape (value,)
    """

    at: Array
    weight: Array
    spread: Array

    @property
    def effective_count(self) -> float:
        """How many values of equal weight had the same entropy."""
        return float(np.exp(-np.sum(self.weight * np.log(self.weight))))

    def without_negligible(self) -> MixingDensity:
        """Return the values that have a weight worth computing."""
        held = self.weight > NEGLIGIBLE_WEIGHT
        return MixingDensity(self.at[held], self.weight[held] / self.weight[held].sum(), self.spread[held])

    def reweighted(self, mean: Array, variance: Array, prior_mean: float, prior_variance: float) -> tuple[Array, Array]:
        """Return mean and variance of normal posteriors, shape (time,), whose normal prior density is exchanged.

        A posterior in proportion to likelihood times normal prior becomes one to likelihood times this density.
        """
        given = np.log(self.weight)
        moments = np.empty((2, len(mean)))
        for first in range(0, len(mean), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            # What the readings say without the prior: a normal likelihood again.
            precision = np.maximum(1 / variance[some] - 1 / prior_variance, LEAST_TOLD / variance[some])[:, None]
            told = (mean[some] / variance[some] - prior_mean / prior_variance)[:, None] / precision
            chance = cut_off(given + self.log_likelihood(told, 1 / precision))
            moments[:, some] = np.einsum("tv,ktv->kt", chance, self.moments(told, 1 / precision)) / chance.sum(axis=1)
        return moments[0], np.maximum(moments[1] - moments[0] ** 2, 0.0)

    def log_likelihood(self, reading: Array, variance: Array | float) -> Array:
        """Return that of each value, given readings of shape (…, 1) with this error variance, but for a constant."""
        total = variance + self.spread
        return np.asarray(-0.5 * ((reading - self.at) ** 2 / total + np.log(total)))

    def moments(self, reading: Array, variance: Array | float) -> Array:
        """Return the truth's mean and mean square at each value, given readings (…, 1), shape (2, …, value).

        An error variance of ∞ stands for a reading that is not known.
        """
        share = self.spread / (variance + self.spread)
        mean = self.at + share * (reading - self.at)
        return np.stack((mean, mean**2 + (1 - share) * self.spread))


def mixing_density(readings: Array, deviation: float) -> MixingDensity:
    """Return the density of the true values behind finite readings (n,) with normal errors of this deviation."""
    at, count, spread = _cells(readings, GRID_STEP * deviation)
    bins, in_bin = _occupied(readings, BIN_STEP * deviation, MOST_BINS)
    weight, share = count / count.sum(), in_bin / in_bin.sum()
    likelihood = cut_off(MixingDensity(at, weight, spread).log_likelihood(bins[:, None], deviation**2))
    for _ in range(ROUNDS):
        weight = weight * ((share / (likelihood @ weight)) @ likelihood)
    weight = np.maximum(weight, LEAST_WEIGHT)
    return MixingDensity(at, weight / weight.sum(), spread)


def cut_off(exponent: Array) -> Array:
    """Return exponentials in proportion along the last axis, the greatest 1, none of them negligible."""
    beside = exponent - exponent.max(axis=-1, keepdims=True)
    return np.exp(np.maximum(beside, NEGLIGIBLE_EXPONENT, out=beside), out=beside)


def _cells(readings: Array, step: float) -> tuple[Array, Array, Array]:
    """Return means, counts and the truth's variance of cells of readings: of the grid, or wider where few are read.

    Over a range of a thousand errors most of the grid's steps have a reading or none, and an atom has hundreds. It
    keeps the fine steps, and what lies between is any value of a wider cell.
    """
    place = ((readings - float(readings.min())) / step).astype(np.int64)
    places, of_place = np.unique(place, return_inverse=True)
    count, total = np.bincount(of_place).astype(np.float64), np.bincount(of_place, readings)
    if len(places) <= MOST_VALUES:
        return total / count, count, np.zeros(len(places))
    # A cell ends where the count passes a multiple of a cell's share: it has about that share, or is one step.
    cell = np.unique((np.cumsum(count) - 0.5 * count) // (count.sum() / MOST_VALUES), return_inverse=True)[1]
    first, last = np.flatnonzero(np.diff(cell, prepend=-1)), np.flatnonzero(np.diff(cell, append=cell[-1] + 1))
    width = (places[last] - places[first]) * step
    members, sums = (np.bincount(cell, each).astype(np.float64) for each in (count, total))
    return sums / members, members, width**2 / 12


def _occupied(readings: Array, step: float, most: int) -> tuple[Array, Array]:
    """Return means and counts of readings in bins at least this wide that have any; wider ones until they are few."""
    least = float(readings.min())
    step = max(step, FINEST_SHARE * float(np.ptp(readings)), 1e-300)
    place = ((readings - least) / step).astype(np.int64)
    count, total = np.bincount(place).astype(np.float64), np.bincount(place, readings - least)
    while np.count_nonzero(count) > most:
        pairs = np.zeros((2, -(-len(count) // 2) * 2))
        pairs[:, : len(count)] = count, total
        count, total = pairs.reshape(2, -1, 2).sum(axis=2)
    held = count > 0
    return least + total[held] / count[held], count[held]
