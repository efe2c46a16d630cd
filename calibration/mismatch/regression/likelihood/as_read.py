"""A fit to the readings as they were read, not whitened: ordinary least squares, weighted by the long-run variance.

Sums over ranges of a covariate have no order in time, so they cannot be whitened. Nor does the size of a structure
that has no law hang on how quickly it changes, as it would where a curve that is not quite its form is fitted to
whitened readings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.normal_equations import SINGULAR, membership
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse
from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import Columns, NormalEquations

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AsRead:
    """A fit's terms, fitted to the readings as they were read.

    Attributes
    ----------
    fit: with these coefficients and their covariance
    columns: of the fit, 0 on wheels that they do not act on, shape (column, wheel, time in the order of folds)
    residual: measured less predicted, shape (wheel, time in the order of folds)
    weights: one over the long-run variance of what a fit leaves, shape (wheel,)
    """

    fit: Fit
    columns: Array
    residual: Array
    weights: Array


def columns_on_wheels(equations: NormalEquations, of: Columns) -> Array:
    """Return columns as read, 0 on wheels that they do not act on, shape (column, wheel, time by folds)."""
    columns = equations.design.columns_as_read([column for column, _ in of])
    on = membership(of, len(equations.weights))
    return np.asarray(columns * on[:, :, None], np.float64)


def left_beside(equations: NormalEquations, fit: Fit, series: Array) -> Array:
    """Return what a fit's columns, held by the priors, leave of other courses, shape (series, time, wheel) as these.

    Where a course is missing from the prediction, this is what the fit leaves of the readings: free parameters take up
    the rest of it (Frisch, Waugh and Lovell).
    """
    design, courses = equations.design, equations.design.in_folds(np.where(equations.problem.mask, series, 0.0))
    on = membership(fit.columns, len(equations.weights))[:, :, None]
    columns, as_they_are = (
        design.columns([column for column, _ in fit.columns]) * on,
        columns_on_wheels(equations, fit.columns),
    )
    moment = np.einsum("cwt,swt,w->cs", columns, design.whitened(courses), equations.weights, optimize=True)
    taken_up = np.einsum("cs,cwt->swt", fit.covariance @ moment, as_they_are, optimize=True)
    return np.asarray(design.in_time(courses - taken_up))


def long_run_weights(equations: NormalEquations, fit: Fit) -> Array:
    """Return one over the long-run variance of what a fit leaves, shape (wheel,); the weights, where not whitened."""
    if equations.design.whitening is NOT_WHITENED:
        return equations.weights
    return equations.problem.noise_of(residual_of(equations, fit)).weights


def as_read(equations: NormalEquations, fit: Fit) -> AsRead:
    """Fit the terms of a fit to the readings as they were read."""
    design, nuisance = equations.design, equations.nuisance
    weights = long_run_weights(equations, fit)
    residual = design.residual_as_read.astype(np.float64)
    columns = columns_on_wheels(equations, fit.columns)
    weighted = columns * weights[:, None]
    matrix = np.einsum("awt,bwt->ab", weighted, columns, optimize=True)
    moment = np.einsum("awt,wt->a", weighted, residual, optimize=True)
    base = len(nuisance.columns)
    matrix[range(base), range(base)] += nuisance.precision
    moment[:base] += nuisance.precision * nuisance.centre
    inverse = pseudo_inverse(matrix, SINGULAR)
    return AsRead(replace(fit, coefficients=inverse @ moment, covariance=inverse), columns, residual, weights)
