"""One noisy input's true values, by the density of its values beside the autoregression's normal one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.jump_chain import JumpChain, Windows, windows_of
from regolithd.calibration.mismatch.signal.mixing_density import MixingDensity, mixing_density
from regolithd.calibration.mismatch.signal.stein import (
    BATCH,
    FEWEST_BATCHES,
    Estimate,
    best_combination,
    clearly_better,
    consistent,
)

Array = NDArray[np.float64]

MOST_FITTED = 16
"""Windows (of 256 instants each) in which the models are fitted and compared: longer recordings cost no more."""
LEAST_VARIANCE = 1e-4
"""The truth's variance in error variances, below which it is a constant: there is nothing to be told of its density."""
LEAST_ERROR = 0.001
"""Error in standard deviations of the truth below which no density is asked for (a choice). An error of a twentieth
biases a coefficient by a quarter of a percent, but where a column rests at a level for most of the time, its readings
there are nothing but error, and all that is left of a residual follows them."""
LEAST_POSTERIOR = 1e-6
"""A posterior's variance in error variances is at least this, that of a million readings: less is rounding."""


@dataclass(frozen=True, eq=False)
class NormalTruth:
    """What a first-order autoregressive normal model says of one column's true values.

    Attributes
    ----------
    mean, variance: given all readings, shape (time,)
    prior_mean, prior_variance, persistence: of the model
    """

    mean: Array
    variance: Array
    prior_mean: float
    prior_variance: float
    persistence: float


def refined_by_density(readings: Array, deviation: float, starts: NDArray[np.int64], normal: NormalTruth) -> Array:
    """Return the truth's conditional expectation, shape (time,); `normal.mean` where a density is no clear gain.

    `readings` (time,), NaN where there are none, have normal errors of this deviation; runs begin at `starts`.
    """
    variance, known = deviation**2, np.isfinite(readings)
    told_apart = LEAST_VARIANCE * variance < normal.prior_variance < variance / LEAST_ERROR**2
    if not told_apart or known.sum() < BATCH * FEWEST_BATCHES:
        return normal.mean
    # About its mean, a column far from 0 has all its digits in its squares.
    centred = replace(normal, mean=normal.mean - normal.prior_mean, prior_mean=0.0)
    found = _refined(readings - normal.prior_mean, deviation, starts, centred)
    return normal.mean if found is None else np.where(np.isfinite(normal.mean), found + normal.prior_mean, np.nan)


def _refined(readings: Array, deviation: float, starts: NDArray[np.int64], normal: NormalTruth) -> Array | None:
    """Return the best combination everywhere, None where it is no clear gain."""
    fitted = windows_of(readings, starts, MOST_FITTED)
    density = mixing_density(readings[np.isfinite(readings)], deviation)
    chain = JumpChain(density, normal.persistence, deviation).fitted(fitted)
    known = np.isfinite(readings[fitted.rows])
    estimates = [_at(each, known) for each in _estimates(fitted, normal, density, chain)]
    read, variance = readings[fitted.rows][known], deviation**2
    combination = best_combination(read, estimates)
    new = combination.of(estimates)
    better = clearly_better(read, variance, new, estimates[0], density.effective_count)
    if not (better and consistent(read, variance, new)):
        return None
    everywhere = windows_of(readings, starts, len(readings))
    return combination.of(_estimates(everywhere, normal, density, chain)).mean


def _estimates(windows: Windows, normal: NormalTruth, density: MixingDensity, chain: JumpChain) -> list[Estimate]:
    """Return what the autoregression, the same with the density, and the chain say at the windows' rows."""
    mean = np.nan_to_num(normal.mean[windows.rows], nan=normal.prior_mean)
    variance = np.maximum(normal.variance[windows.rows], LEAST_POSTERIOR * chain.deviation**2)
    exchanged = density.reweighted(mean, variance, normal.prior_mean, normal.prior_variance)
    return [Estimate(mean, variance), Estimate(*exchanged), Estimate(*chain.posterior(windows))]


def _at(estimate: Estimate, known: NDArray[np.bool_]) -> Estimate:
    """Return an estimate at some of its instants."""
    return Estimate(estimate.mean[known], estimate.variance[known])
