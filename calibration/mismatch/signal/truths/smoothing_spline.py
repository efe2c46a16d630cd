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
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.truths.stein import Estimate, squared_error

if TYPE_CHECKING:
    from collections.abc import Iterator

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
ROUNDS_OF_A_WIDTH = 3
"""Rounds with each width, where those of the width before are the beginning (a choice: of 64
columns 62 have the same best spline as with all of `ROUNDS`, and 61 with two)."""
MOVES = 2
"""Directions in which readings are moved (a choice: thousands of them average out)."""
MOVED_BY = 0.1
"""How far readings are moved, in standard deviations of their error (a choice: little, and far above rounding)."""
CORE = 512
"""Instants of a part of a recording in which a spline is found: its ends are hardly a hundredth of it."""
MOST_FITTED = 4
"""Parts in which a spline is found: longer recordings cost no more."""
UNEVEN = 3.0
"""Factor between a step of time and the usual one beyond which readings are not taken together across it."""
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
        equations, weights = _Equations.of(readings, rows, self.order), np.ones(len(rows))
        for exponent in ROUNDS if self.heavy else (1.0,):
            penalty = self.penalty ** (exponent if self.penalty > 1 else 1.0)
            (found,) = equations.solved(penalty * weights)
            if self.heavy:
                weights = equations.weights(found, penalty, deviation)
        return np.asarray(found)

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


@dataclass(frozen=True, eq=False)
class _Equations:
    """Least squares of readings (time,) and weighted differences; `rows` (difference, order + 1) are the differences.

    A blank has a reading on a straight line, with next to no weight.
    """

    read: Array
    of_reading: Array
    rows: Array

    @classmethod
    def of(cls, readings: Array, rows: Array, order: int) -> _Equations:
        """Return those of readings with NaN where there are none."""
        known = np.isfinite(readings)
        if known.all():
            return cls(readings, np.ones(len(readings)), rows)
        at = np.arange(len(readings))
        if len(rows):  # within a long blank nothing is known, and nothing is asked
            near = np.any(sliding_window_view(np.pad(known, BRIDGED), order + 1 + 2 * BRIDGED), axis=1)
            rows = np.where(np.reshape(near, (-1, 1)), rows, 0.0)
        return cls(np.interp(at, at[known], readings[known]), np.where(known, 1.0, UNKNOWN), rows)

    def solved(self, penalties: Array, *others: Array) -> Array:
        """Return the estimates for the readings, and for other right sides, shape (1 + others, time)."""
        from scipy.linalg import solveh_banded  # noqa: PLC0415  # reading a recording must not load SciPy

        order = self.rows.shape[1] - 1
        band = np.zeros((order + 1, len(self.read)))  # the upper form of SciPy
        weighted = penalties[:, None] * self.rows
        for i in range(order + 1):
            for j in range(i, order + 1):
                band[order - (j - i), j : j + len(self.rows)] += weighted[:, i] * self.rows[:, j]
        band[-1] += self.of_reading
        right = np.stack([self.of_reading * self.read, *others], axis=1)
        return np.asarray(solveh_banded(band, right, overwrite_ab=True, overwrite_b=True, check_finite=False)).T

    def weights(self, found: Array, penalty: float, deviation: float) -> Array:
        """Return the weights with which least squares have the slope of a density with heavy tails."""
        parts = np.stack([found[k : k + len(self.rows)] for k in range(self.rows.shape[1])], axis=1)
        difference = np.einsum("tk,tk->t", self.rows, parts)
        return np.asarray(2 / (1 + penalty * (difference / deviation) ** 2))


def with_fixed_weights(
    order: int, readings: Array, deviation: float, rows: Array
) -> Iterator[tuple[SmoothingSpline, Estimate]]:
    """Yield the splines with heavy tails, from the least width on, with an estimate whose error seems too small.

    Its weights are found from those of the width before, and its variance is as if they did not depend on the readings.
    """
    equations, weights = _Equations.of(readings, rows, order), np.ones(len(rows))
    (lot,) = _lots(1, len(readings))
    for width in HEAVY_WIDTHS:
        spline = SmoothingSpline(order, width, heavy=True)
        for _ in range(ROUNDS_OF_A_WIDTH):
            found, change = equations.solved(spline.penalty * weights, lot)
            weights = equations.weights(found, spline.penalty, deviation)
        yield spline, Estimate(found, deviation**2 * lot * change)


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
    heavy = (pair for order in HEAVY_ORDERS for pair in with_fixed_weights(order, readings, deviation, rows[order]))
    seeming = sorted(((error(estimate), spline) for spline, estimate in heavy), key=lambda pair: pair[0])
    for at_least, spline in seeming:
        if at_least >= least:
            break
        least, best = min((least, best), (error(spline.estimate(*given(spline))), spline), key=lambda pair: pair[0])
    return best


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
    within, usual = even_steps(time, run)
    whole = np.all([within[k : len(within) - order + 1 + k] for k in range(order)], axis=0)
    at = np.stack([time[k : len(time) - order + k] for k in range(order + 1)], axis=1)
    apart = np.where(whole[:, None, None], at[:, :, None] - at[:, None, :], 1.0)
    apart[:, range(order + 1), range(order + 1)] = 1.0
    return np.asarray(np.where(whole[:, None], factorial(order) * usual**order / np.prod(apart, axis=2), 0.0))


def even_steps(time: Array, run: NDArray[np.int64]) -> tuple[NDArray[np.bool_], float]:
    """Return which steps of time (step,) are even and within a run, and the usual step, 0 where there is none."""
    steps = np.diff(time)
    within = (np.diff(run) == 0) & (steps > 0)
    usual = float(np.median(steps[within])) if within.any() else 0.0
    return within & (steps > usual / UNEVEN) & (steps < usual * UNEVEN), usual


def fitted_rows(readings: Array, run: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows of a recording in which a spline is found, and a number for each of their unbroken stretches.

    They are parts of `CORE` rows: of each stretch of the recording, the one whose readings change most. A spline that
    was found in dwells alone would smooth away the steps between others.
    """
    count = max(len(readings) // CORE, 1)
    parts = [slice(first, min(first + CORE, len(readings))) for first in range(0, count * CORE, CORE)]
    changes = [np.diff(readings[part]) for part in parts]
    moved = np.array([np.sum(each[np.isfinite(each)] ** 2) for each in changes])
    stretches = np.array_split(np.arange(count), min(count, MOST_FITTED))
    chosen = [parts[each[np.argmax(moved[each])]] for each in stretches]
    rows = np.concatenate([np.arange(len(readings))[part] for part in chosen])
    part_of = np.concatenate([np.full(part.stop - part.start, number) for number, part in enumerate(chosen)])
    return rows, run[rows] * len(chosen) + part_of


@cache
def _share_left(order: int, penalty: float) -> float:
    """Return the posterior's variance over the error's, in the middle of readings at even steps."""
    response = 1 / (1 + penalty * (2 * np.sin(FREQUENCIES / 2)) ** (2 * order))
    return float(response.mean())
