"""How far estimates of what was measured are from the truth, without the truth: Stein's lemma.

A reading is the truth plus a normal error of a known variance. For an estimate of the truth from the readings,

    E[(truth − estimate) h] = E[(reading − estimate) h] − error variance · E[∂h/∂reading]

for any function h of the readings (Stein, 1981). A posterior mean's derivative by its own reading is the posterior's
variance over the error's, whatever its prior density. So the mean square error of estimates from different models is
compared, and they are combined, with nothing assumed of the truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

BATCH, SHORTEST_BATCH = 50, 25
"""Readings whose mean is one independent value, where the chance of a difference is judged, and as few as these where
a recording has no more (a choice)."""
DEVIATIONS = 2.5
"""Standard deviations from which a difference is none of chance (a choice: 1 in 160 of equal ones)."""
GREATEST_SURPLUS = 0.25
"""Share of the error variance by which what a model leaves may differ from what it should leave: an error stated a
quarter too large is tolerated where the model smooths well (a choice: models that are not quite right have 0.2)."""
LEAST_GAIN = 0.25
"""Share of the mean square error that has to be gained (a choice: jumps and levels gain half of it and more, smooth
motions a tenth; there other inputs follow the same motion, and would take up what an estimate that is not linear in the
readings leaves of it)."""
MOST_LEFT = 3.0
"""Mean square of what a model leaves in a batch of readings, in error variances, beyond which it is refuted there (a
choice: noise that is half as large again as stated leaves 2.25, a step of two errors that is smoothed away 4)."""
FEWEST_BATCHES = 4
"""Batches below which nothing is judged."""
FEWEST_READINGS = FEWEST_BATCHES * SHORTEST_BATCH
"""Readings that these are."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Posterior mean and variance of the truth under some model, shape (time,) each."""

    mean: Array
    variance: Array


@dataclass(frozen=True, eq=False)
class Combination:
    """centre + Σ share (mean − centre of mean), for estimates in their order."""

    centre: float
    shares: Array
    centres: Array

    def of(self, estimates: Sequence[Estimate]) -> Estimate:
        """Return the combined estimate."""
        means = np.stack([each.mean for each in estimates], axis=1)
        variances = np.stack([each.variance for each in estimates], axis=1)
        return Estimate(self.centre + (means - self.centres) @ self.shares, variances @ self.shares)


def squared_error(readings: Array, error_variance: float, estimate: Estimate) -> Array:
    """Return an unbiased estimate of each (estimate − truth)², shape (time,)."""
    return (estimate.mean - readings) ** 2 - error_variance + 2 * estimate.variance


def consistent(readings: Array, error_variance: float, estimate: Estimate) -> bool:
    """Return whether readings differ from a posterior mean by as much as the model says.

    They differ by the error's variance less the posterior's. Much less is left where the stated error is too large: all
    else here would then follow it into the noise's details.
    """
    left = float(np.mean((readings - estimate.mean) ** 2 + estimate.variance)) / error_variance
    return abs(left - 1) < GREATEST_SURPLUS


def consistent_throughout(readings: Array, error_variance: float, mean: Array) -> bool:
    """Return whether readings differ by no more in any batch: models are fitted to parts of a recording alone."""
    return bool(np.all(_batch_means((readings - mean) ** 2) <= MOST_LEFT * error_variance))


def _batch_means(values: Array) -> Array:
    """Return the means of batches of values (time,), shape (batch,); of values at the end that fill none, nothing."""
    length = int(np.clip(len(values) // FEWEST_BATCHES, SHORTEST_BATCH, BATCH))
    return values[: len(values) // length * length].reshape(-1, length).mean(axis=1)


def best_combination(readings: Array, estimates: Sequence[Estimate]) -> Combination:
    """Return the combination without negative shares that has the least mean square error.

    Regressing the truth on it, or on any estimate that it has a share of, leaves no slope of what remains.
    """
    centres = np.array([each.mean.mean() for each in estimates])
    centred = np.stack([each.mean for each in estimates], axis=1) - centres
    products = centred.T @ centred / len(readings)
    # Stein's lemma: the truth's covariance with each estimate.
    with_truth = centred.T @ readings / len(readings) - np.array([each.variance.mean() for each in estimates])
    best, least = np.zeros(len(estimates)), 0.0
    for count in range(1, len(estimates) + 1):
        for chosen in map(list, combinations(range(len(estimates)), count)):
            shares = np.linalg.lstsq(products[np.ix_(chosen, chosen)], with_truth[chosen], rcond=1e-9)[0]
            error = -float(shares @ with_truth[chosen])
            if error < least and np.all(shares >= 0):
                best, least = np.zeros(len(estimates)), error
                best[chosen] = shares
    return Combination(float(readings.mean()), best, centres)


def clearly_better(
    readings: Array,
    error_variance: float,
    new: Estimate,
    old: Estimate,
    fitted: float,
    least_gain: float = LEAST_GAIN,
) -> bool:
    """Return whether an estimate's error is below another's by more than chance, and by a share of it.

    `fitted` is how many numbers of its model were fitted to the same readings: each makes its error look smaller by
    about two error variances over the number of readings.
    """
    before = squared_error(readings, error_variance, old)
    gain = before - squared_error(readings, error_variance, new)
    batches = _batch_means(gain)
    if len(batches) < FEWEST_BATCHES:
        return False
    chance = float(batches.std(ddof=1)) / np.sqrt(len(batches))
    by_chance = DEVIATIONS * chance + 2 * fitted * error_variance / len(gain)
    return bool(gain.mean() > max(by_chance, least_gain * float(before.mean())))
