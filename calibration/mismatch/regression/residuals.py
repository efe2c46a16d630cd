"""What a fit explains at each instant: the residual that it leaves, and the contribution of each term."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Columns = NDArray[np.float32]


def residual_of(equations: NormalEquations, fit: Fit) -> Array:
    """Return measured less fitted, shape (time, wheel), 0 outside the mask."""
    design = equations.design
    return design.in_time(residual_as_read_of(equations, fit))


def whitened_residual_of(equations: NormalEquations, fit: Fit) -> Array:
    """Return measured less fitted, whitened, shape (wheel, time in the order of folds)."""
    design = equations.design
    return _less_fitted(design.residual, design.columns, fit)


def residual_as_read_of(equations: NormalEquations, fit: Fit) -> Array:
    """Return measured less fitted as read, shape (wheel, time in the order of folds), 0 outside the mask."""
    design = equations.design
    return _less_fitted(design.residual_as_read, design.columns_as_read, fit)


def _less_fitted(residual: NDArray[np.float32], columns_at: Callable[[Sequence[int]], Columns], fit: Fit) -> Array:
    """Return a residual (wheel, time) less what a fit explains of it, with the columns that `columns_at` returns."""
    left = residual.astype(np.float64)
    columns = columns_at([column for column, _ in fit.columns])
    for column, (_, wheels), value in zip(columns, fit.columns, fit.coefficients, strict=True):
        for w in wheels:
            left[w] -= value * column[w]
    return left


def chi2_of(equations: NormalEquations, fit: Fit) -> Array:
    """Return the weighted sum of squares that a fit leaves, shape (wheel,)."""
    return np.asarray(np.sum(whitened_residual_of(equations, fit) ** 2, axis=1) * equations.weights)


def contribution(equations: NormalEquations, fit: Fit, index: int) -> Array:
    """Return what a term adds to the prediction, shape (time, wheel)."""
    design, term = equations.design, fit.terms[index]
    total = np.zeros(design.residual.shape)
    columns = design.columns_as_read(term.group.columns)
    for column, value in zip(columns, fit.coefficients[fit.of_term(index)], strict=True):
        for w in term.wheels:
            total[w] += value * column[w]
    return design.in_time(total)


def where_it_acts(equations: NormalEquations, fit: Fit, index: int) -> Array:
    """Return a term's contribution to each reading of its wheels, shape (reading,).

    A change of an effect that was corrected on one wheel is asked for on all, and acts on that one.
    """
    course = contribution(equations, fit, index)
    wheels = fit.terms[index].wheels
    on = [wheel for wheel in wheels if course[:, wheel].any()] or list(wheels)
    return course[:, on][equations.problem.mask[:, on]]


def relative_size(equations: NormalEquations, fit: Fit, index: int) -> float:
    """Return a term's active root mean square on its wheels over the channel's mean magnitude."""
    squares = where_it_acts(equations, fit, index) ** 2
    return active_rms(squares, equations.thresholds.active_share) / equations.problem.mean_size


def active_rms(squares: Array, active_share: float) -> float:
    """Return how large an effect with these squares is while it acts.

    Of a constant effect that is its root mean square; of an intermittent one, `active_share` of the root mean square
    weighted by its own squares.
    """
    return active_size(float(np.sum(squares)), float(np.sum(squares**2)), squares.size, active_share)


def active_size(squares: float, fourths: float, readings: float, active_share: float) -> float:
    """Return the same from the sums of an effect's squares and fourth powers over so many readings."""
    return float(np.sqrt(max(squares / max(readings, 1.0), active_share**2 * fourths / max(squares, 1e-300))))
