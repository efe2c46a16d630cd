"""Smoothing splines: the truth of a column as repeatedly integrated noise.

A speed, a temperature or a load that moves smoothly is not first-order autoregressive: its increments go on as they
were. Where the `order`-th differences of the truth are white noise of the variance q, its posterior mean given
readings with the error variance R minimises

    Σ (reading − truth)² + λ Σ (order-th difference of the truth)²,    λ = R/q

(Whittaker, 1923; Wahba, 1978). Order 2 follows ramps, higher orders what has no corners. A machine that is driven in
ramps and dwells has differences of 0 but at its corners: there the noise has a density with heavy tails, Cauchy's, and
the posterior's mode is found by least squares with weights that the differences themselves give.

Which of these is nearest to the truth is told by Stein's unbiased estimate of the mean square error, with R known. It
needs how much an estimate changes with its reading, which for heavy tails is found by moving the readings a little
(Ramani, Blu and Unser, 2008).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import factorial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.stein import Estimate, squared_error

Array = NDArray[np.float64]

ORDERS = (2, 3, 5)
"""Orders of the differences that are normal noise: of ramps, of what is smoother, and of what is as if band-limited, of
which a high order leaves the amplitude as it is."""
HEAVY_ORDERS = (2, 3)
"""Those that have heavy tails: of a speed in ramps and dwells, and of one whose rate is."""
WIDTHS = tuple(float(each) for each in np.geomspace(0.6, 30.0, 14))
"""Widths that are tried with normal noise, in instants (a choice: a third apart)."""
HEAVY_WIDTHS = tuple(float(each) for each in np.geomspace(1.0, 30.0, 7))
"""Widths that are tried with heavy tails (a choice: they adapt themselves)."""
MOST_PENALTY = 1e12
"""λ times the greatest eigenvalue of a difference's square, at most: of sixteen digits, four are left."""
ROUNDS = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0, 1.0)
"""Exponents of λ in the rounds of weighted least squares with heavy tails (a choice: a corner that the first round
rounds off is found no more; begun with little smoothing, a half to two thirds of the error is left)."""
MOVES = 2
"""Directions in which readings are moved (a choice: thousands of them average out)."""
MOVED_BY = 0.1
"""How far readings are moved, in standard deviations of their error (a choice: little, and far above rounding)."""
CORE = 512
"""Instants of a part of a recording in which a spline is found: its ends are hardly a hundredth of it."""
MOST_FITTED = 4
"""Parts in which a spline is found: longer recordings cost no more."""
UNEVEN = 3.0
"""Factor between a step of time and the usual one beyond which no difference is taken across it."""
BRIDGED = 8
"""Instants from a reading beyond which a blank is left alone."""
UNKNOWN = 1e-4
"""Weight of a blank, on a straight line between readings, beside that of a reading (a choice: next to none, and the
equations stay regular)."""
FREQUENCIES = (np.arange(1024) + 0.5) * np.pi / 1024
"""Angular frequencies per instant over which a smoother's response is averaged."""


@dataclass(frozen=True)
class SmoothingSpline:
    """Differences of this order are noise, normal or with heavy tails.

    `width` is how many instants it smooths over: λ is width^(2 order), so that it passes half of the amplitude of an
    oscillation with the angular frequency 1/width per instant.
    """

    order: int
    width: float
    heavy: bool = False

    @property
    def penalty(self) -> float:
        """λ."""
        return float(self.width ** (2 * self.order))

    def mean(self, readings: Array, deviation: float, rows: Array) -> Array:
        """Return the estimate of the truth, shape (time,), from readings with NaN where there are none.

        `rows` are those of `differences`, of this order; `deviation` is the standard deviation of the readings' error.
        """
        return self._fitted(readings, deviation, rows)[0]

    def estimate(self, readings: Array, deviation: float, rows: Array) -> Estimate:
        """Return the estimate with what stands for its variance in Stein's lemma: R times its change per reading."""
        mean = self.mean(readings, deviation, rows)
        if not self.heavy:
            return Estimate(mean, np.full(mean.shape, deviation**2 * _share_left(self.order, self.penalty)))
        step, change = MOVED_BY * deviation, np.zeros(mean.shape)
        for lot in _lots(MOVES, len(mean)):
            one, other = (self.mean(readings + sign * step * lot, deviation, rows) for sign in (1.0, -1.0))
            change += lot * (one - other) / (2 * step)
        return Estimate(mean, deviation**2 * change / MOVES)

    def with_fixed_weights(self, readings: Array, deviation: float, rows: Array) -> Estimate:
        """Return the estimate as if its weights did not depend on the readings: one whose error seems too small."""
        mean, band = self._fitted(readings, deviation, rows)
        (lot,) = _lots(1, len(mean))
        return Estimate(mean, deviation**2 * lot * _solved(band, lot))

    def _fitted(self, readings: Array, deviation: float, rows: Array) -> tuple[Array, Array]:
        """Return the estimate, and the matrix of its equations in SciPy's upper form."""
        known = np.isfinite(readings)
        at, of_reading = np.arange(len(readings)), np.where(known, 1.0, UNKNOWN)
        read = readings if known.all() else np.interp(at, at[known], readings[known])
        if len(rows) and not known.all():  # within a long blank nothing is known, and nothing is asked
            near = np.any(sliding_window_view(np.pad(known, BRIDGED), self.order + 1 + 2 * BRIDGED), axis=1)
            rows = np.where(np.reshape(near, (-1, 1)), rows, 0.0)
        found, band, weights = read, np.zeros((self.order + 1, len(readings))), np.ones(len(rows))
        for exponent in ROUNDS if self.heavy else (1.0,):
            penalty = self.penalty ** (exponent if self.penalty > 1 else 1.0)
            band = np.zeros((self.order + 1, len(readings)))
            weighted = (penalty * weights)[:, None] * rows
            for i in range(self.order + 1):
                for j in range(i, self.order + 1):
                    band[self.order - (j - i), j : j + len(rows)] += weighted[:, i] * rows[:, j]
            band[-1] += of_reading
            found = _solved(band, of_reading * read)
            if self.heavy:
                parts = np.stack([found[k : k + len(rows)] for k in range(self.order + 1)], axis=1)
                difference = np.einsum("tk,tk->t", rows, parts)
                weights = 2 / (1 + penalty * (difference / deviation) ** 2)
        return found, band


def best_spline(
    readings: Array, deviation: float, time: Array, run: NDArray[np.int64], exact: NDArray[np.bool_]
) -> SmoothingSpline:
    """Return the spline whose mean square error is least by Stein's estimate, over the readings that are not exact."""
    known = np.isfinite(readings) & ~exact
    rows = {order: differences(time, run, order) for order in ORDERS}

    def error(estimate: Estimate) -> float:
        found = Estimate(estimate.mean[known], estimate.variance[known])
        return float(squared_error(readings[known], deviation**2, found).mean())

    def given(spline: SmoothingSpline) -> tuple[Array, float, Array]:
        return readings, deviation, rows[spline.order]

    normal = (SmoothingSpline(order, each) for order in ORDERS for each in WIDTHS)
    normal = (each for each in normal if each.penalty * 4**each.order < MOST_PENALTY)
    least, best = min(((error(each.estimate(*given(each))), each) for each in normal), key=lambda pair: pair[0])
    heavy = (SmoothingSpline(order, each, heavy=True) for order in HEAVY_ORDERS for each in HEAVY_WIDTHS)
    seeming = sorted(((error(each.with_fixed_weights(*given(each))), each) for each in heavy), key=lambda pair: pair[0])
    for at_least, spline in seeming:
        if at_least >= least:
            break
        least, best = min((least, best), (error(spline.estimate(*given(spline))), spline), key=lambda pair: pair[0])
    return best


def _solved(band: Array, right: Array) -> Array:
    """Return the solution of equations whose matrix is in SciPy's upper form."""
    from scipy.linalg import solveh_banded  # noqa: PLC0415  # reading a recording must not load SciPy

    return np.asarray(solveh_banded(band, right))


def _lots(count: int, length: int) -> Array:
    """Return series of +1 and −1 by lot, shape (series, instant)."""
    return np.random.default_rng(0).choice([-1.0, 1.0], size=(count, length))


def differences(time: Array, run: NDArray[np.int64], order: int) -> Array:
    """Return the weights of each difference of an order, shape (difference, order + 1).

    They are divided differences times what makes them binomial coefficients where the steps of time are even. They are
    0 across uneven steps, and from one run to the next.
    """
    if len(time) <= order:
        return np.zeros((0, order + 1))
    steps = np.diff(time)
    within = (np.diff(run) == 0) & (steps > 0)
    usual = float(np.median(steps[within])) if within.any() else 0.0
    within &= (steps > usual / UNEVEN) & (steps < usual * UNEVEN)
    whole = np.all([within[k : len(steps) - order + 1 + k] for k in range(order)], axis=0)
    at = np.stack([time[k : len(time) - order + k] for k in range(order + 1)], axis=1)
    apart = np.where(whole[:, None, None], at[:, :, None] - at[:, None, :], 1.0)
    apart[:, range(order + 1), range(order + 1)] = 1.0
    return np.asarray(np.where(whole[:, None], factorial(order) * usual**order / np.prod(apart, axis=2), 0.0))


def fitted_rows(readings: Array) -> list[slice]:
    """Return the parts of a recording in which a spline is found: of each stretch, the one whose readings change most.

    A spline that was found in dwells alone would smooth away the steps between others.
    """
    count = max(len(readings) // CORE, 1)
    parts = [slice(first, min(first + CORE, len(readings))) for first in range(0, count * CORE, CORE)]
    changes = [np.diff(readings[part]) for part in parts]
    moved = np.array([np.sum(each[np.isfinite(each)] ** 2) for each in changes])
    stretches = np.array_split(np.arange(count), min(count, MOST_FITTED))
    return [parts[each[np.argmax(moved[each])]] for each in stretches]


@cache
def _share_left(order: int, penalty: float) -> float:
    """Return the posterior's variance over the error's, in the middle of readings at even steps."""
    response = 1 / (1 + penalty * (2 * np.sin(FREQUENCIES / 2)) ** (2 * order))
    return float(response.mean())
