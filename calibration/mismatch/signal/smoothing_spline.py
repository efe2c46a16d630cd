"""Smoothing splines: the truth of a column as repeatedly integrated white noise.

A speed, a temperature or a load that moves smoothly is not first-order autoregressive: its increments go on as they
were. Where the `order`-th differences of the truth are white noise of the variance q, its posterior mean given
readings with the error variance R minimises

    Σ (reading − truth)² + λ Σ (order-th difference of the truth)²,    λ = R/q

(Whittaker, 1923; Wahba, 1978). Order 2 follows ramps, order 3 what has no corners. λ is found by Stein's unbiased
estimate of the mean square error, with R known.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from regolithd.calibration.mismatch.signal.stein import Estimate, squared_error

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

ORDERS = (2, 3)
"""Orders of the differences that are white noise: of ramps with corners, and of what is smoother."""
PENALTIES = tuple(float(each) for each in 10.0 ** np.arange(-1.0, 6.01, 0.5))
"""λ that are tried (a choice: half a decade changes the spline's width by a fifth)."""
CORE = 512
"""Instants of a part of a recording in which λ is found: its ends are hardly a hundredth of it."""
MOST_FITTED = 8
"""Parts in which λ is found: longer recordings cost no more."""
UNEVEN = 3.0
"""Factor between a step of time and the usual one beyond which no difference is taken across it."""
UNKNOWN = 1e-9
"""Weight of a blank beside that of a reading: next to none, and the equations stay regular."""
FREQUENCIES = (np.arange(1024) + 0.5) * np.pi / 1024
"""Angular frequencies per instant over which a smoother's response is averaged."""


@dataclass(frozen=True)
class SmoothingSpline:
    """Differences of this order are white noise with one over `penalty` of the readings' error variance."""

    order: int
    penalty: float

    def estimate(self, readings: Array, deviation: float, parts: Sequence[Array]) -> Estimate:
        """Return the truth's posterior mean and variance, shape (time,), given readings with NaN where there are none.

        `parts` are times [any unit] of stretches that follow one another; no difference is taken from one to the next.
        """
        known = np.isfinite(readings)
        band = np.zeros((self.order + 1, len(readings)))
        first = 0
        for times in parts:
            rows = _differences(times, self.order)
            for i in range(self.order + 1):
                for j in range(i, self.order + 1):
                    band[self.order - (j - i), first + j : first + j + len(rows)] += rows[:, i] * rows[:, j]
            first += len(times)
        band *= self.penalty
        band[-1] += np.where(known, 1.0, UNKNOWN)
        mean = solveh_banded(band, np.where(known, readings, 0.0))
        return Estimate(mean, np.full(mean.shape, deviation**2 * _share_left(self.order, self.penalty)))


def best_spline(readings: Array, deviation: float, parts: Sequence[Array]) -> SmoothingSpline:
    """Return the spline whose mean square error is least by Stein's estimate; arguments as `estimate` has them."""
    known = np.isfinite(readings)

    def mean_squared_error(spline: SmoothingSpline) -> float:
        estimate = spline.estimate(readings, deviation, parts)
        found = Estimate(estimate.mean[known], estimate.variance[known])
        return float(squared_error(readings[known], deviation**2, found).mean())

    return min((SmoothingSpline(order, each) for order in ORDERS for each in PENALTIES), key=mean_squared_error)


def stretches(time: Array, run: NDArray[np.int64]) -> list[Array]:
    """Return the times of each run."""
    return np.split(time, np.flatnonzero(np.diff(run)) + 1)


def fitted_rows(length: int) -> list[slice]:
    """Return the parts of a recording of so many instants in which a spline is found, evenly spread."""
    count = max(length // CORE, 1)
    chosen = np.arange(count) if count <= MOST_FITTED else np.linspace(0, count - 1, MOST_FITTED).astype(np.int64)
    return [slice(int(each) * CORE, min(int(each) * CORE + CORE, length)) for each in chosen]


def _differences(times: Array, order: int) -> Array:
    """Return the weights of each difference of an order, shape (difference, order + 1), 0 across uneven steps.

    They are divided differences times what makes them binomial coefficients where the steps are even.
    """
    if len(times) <= order:
        return np.zeros((0, order + 1))
    steps = np.diff(times)
    usual = float(np.median(steps))
    even = (steps > usual / UNEVEN) & (steps < usual * UNEVEN) if usual > 0 else np.zeros(steps.shape, np.bool_)
    at = np.stack([times[k : len(times) - order + k] for k in range(order + 1)], axis=1)
    whole = np.all([even[k : len(steps) - order + 1 + k] for k in range(order)], axis=0)
    apart = np.where(whole[:, None, None], at[:, :, None] - at[:, None, :], 1.0)
    apart[:, range(order + 1), range(order + 1)] = 1.0
    weights = factorial(order) * usual**order / np.prod(apart, axis=2)
    return np.asarray(np.where(whole[:, None], weights, 0.0))


@cache
def _share_left(order: int, penalty: float) -> float:
    """Return the posterior's variance over the error's, in the middle of readings at even steps."""
    response = 1 / (1 + penalty * (2 * np.sin(FREQUENCIES / 2)) ** (2 * order))
    return float(response.mean())
