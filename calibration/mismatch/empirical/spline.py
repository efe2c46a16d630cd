"""A penalised spline over a covariate: piecewise linear, as smooth as the recording says, with a band.

Between two smooth functions that fit equally well the one that bends less is more probable: the second differences of
the values at the knots are normal with a variance that maximises the marginal likelihood (Eilers and Marx, 1996; Wood,
2011). The posterior covariance gives the band: averaged over the curve it covers the truth at its level (Nychka, 1988).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.hat_basis import OUTER_QUANTILES

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.empirical.sums import CovariateSums, Profile

Array = NDArray[np.float64]

KNOTS, CLOSE_KNOTS = 24, 96
"""Knots of a curve, and of one over time or that is periodic over its covariate (a choice: the penalty, not their
number, limits how much it bends; what comes and goes with time may do so within a hundredth of the recording, and of
the most cycles that are looked for each has four)."""
SMOOTHNESS = np.logspace(-8, 6, 57)
"""Precisions of the bends that are compared, relative to what the recording says of the values (four in a decade)."""
LEVEL_SHARE = 1e-6
"""Precision of the level and of the slope, likewise: next to none, so that what no data show has a finite band."""


@dataclass(frozen=True, eq=False)
class Spline:
    """Values at the knots, shape (knot,), their covariance, shape (knot, knot), and twice the log evidence over none.

    `basis` are the hat functions in the bins of the sums that it was fitted to, shape (bin, knot).
    """

    at: Array
    value: Array
    covariance: Array
    evidence: float
    basis: Array

    @property
    def in_bins(self) -> Array:
        """Its values in the bins, shape (bin,)."""
        return self.basis @ self.value

    @property
    def std(self) -> Array:
        """Standard deviations at the knots, shape (knot,)."""
        return np.sqrt(np.diag(self.covariance))


def knots_of(sums: CovariateSums, count: int = KNOTS) -> Array:
    """Return knots halfway between quantiles of the covariate and an even spacing, without its outermost readings."""
    below = (np.cumsum(sums.readings) - 0.5 * sums.readings) / sums.readings.sum()
    quantiles = np.interp(np.linspace(*OUTER_QUANTILES, count), below, sums.at)
    return np.unique(0.5 * (quantiles + np.linspace(quantiles[0], quantiles[-1], count)))


def fit_spline(profile: Profile, at: Array, knots: Array) -> Spline:
    """Fit the values at the knots to a profile likelihood over bins at `at`; the best of all smoothnesses."""
    basis = np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))], axis=1)
    matrix, moment = basis.T @ profile.matrix @ basis, basis.T @ profile.moment
    size = float(np.trace(matrix)) / len(knots)
    bends = _second_differences(knots)
    penalty = bends.T @ bends
    penalty *= size * len(knots) / max(float(np.trace(penalty)), 1e-300)
    level = LEVEL_SHARE * size * np.eye(len(knots))
    fits = [_posterior(matrix, moment, smoothness * penalty + level) for smoothness in SMOOTHNESS]
    evidence, value, covariance = max(fits, key=lambda fit: fit[0])
    return Spline(knots, value, covariance, evidence, basis)


def _second_differences(knots: Array) -> Array:
    """Return the changes of slope at the inner knots, times the mean spacing, shape (knot − 2, knot)."""
    steps = np.diff(knots)
    rows = np.zeros((len(knots) - 2, len(knots)))
    for row, (before, after) in enumerate(pairwise(steps)):
        rows[row, row : row + 3] = 1 / before, -1 / before - 1 / after, 1 / after
    return rows * np.mean(steps)


def _posterior(matrix: Array, moment: Array, precision: Array) -> tuple[float, Array, Array]:
    """Return twice the log evidence over values of zero, mean and covariance, for a normal prior about zero."""
    covariance = np.asarray(np.linalg.inv(matrix + precision), np.float64)
    value = covariance @ moment
    evidence = np.linalg.slogdet(precision)[1] + np.linalg.slogdet(covariance)[1] + float(moment @ value)
    return float(evidence), value, covariance
