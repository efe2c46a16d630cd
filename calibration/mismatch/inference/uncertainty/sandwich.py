"""Sandwich covariance: how much estimated coefficients scatter, whatever the autocorrelation of the noise.

The covariance is A⁻¹ B A⁻¹ with A the information and B the covariance of the scores' sums over blocks of time (Huber,
1967; Liang and Zeger, 1986). Shape parameters enter by the slope of the prediction with them, and inexact laws by their
discrepancy (`regression.discrepancy_basis`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.regression.groups.discrepancy_basis import discrepancy_basis
from regolithd.calibration.mismatch.regression.likelihood.as_read import columns_on_wheels
from regolithd.calibration.mismatch.regression.likelihood.lasting_errors import covariance_of_scores, moments_of_errors
from regolithd.calibration.mismatch.regression.residuals import whitened_residual_of
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMALL_STEP = 1e-6
"""Relative step of a shape parameter for the slope of a stated coefficient (double precision)."""
SINGULAR = 1e-9
"""Relative eigenvalue below which a direction counts as undetermined."""


@dataclass(frozen=True)
class ShapeSlope:
    """A shape parameter's part in the linearised fit.

    Attributes
    ----------
    term: index of the term in the fit
    name: the shape parameter's
    scale: root mean square of the prediction's slope with it: its column is divided by this
    """

    term: int
    name: str
    scale: float


@dataclass(frozen=True, eq=False)
class StatedShare:
    """The share of the coefficient that a shape states, 1 at most: inputs with errors show less than happens, not more.

    The fit does not have this prior. Where a law changes in proportion to its shape parameter, nothing else tells the
    coefficient from that.

    Attributes
    ----------
    share, std: where the fit stands, and the standard deviation of its prior, whose mean is 1
    along: its slope with each column of the linearisation, shape (column,)
    """

    share: float
    std: float
    along: Array

    def at_most_one(self, moved: Array, inverse: Array) -> Array:
        """Return draws, shape (draw, column): those with a larger share have 1, and all else at its optimum for that.

        `inverse` is that of the information and the priors, shape (column, column).
        """
        beyond = np.maximum(self.share + moved @ self.along - 1, 0.0)
        follows = inverse @ self.along
        return np.asarray(moved - np.outer(beyond, follows / (self.along @ follows)))


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A fit as a linear function of everything that is uncertain.

    Attributes
    ----------
    columns: coefficients' columns, then shape parameters' slopes, then discrepancies, shape (column, time, wheel)
    precision: of the prior, shape (column, column)
    pull: slope of the log prior where the fit stands, shape (column,); 0 for what the fit has as its prior already
    slopes: what the columns after the coefficients' are
    ends: where each term's discrepancies begin, and after the last one end, shape (term + 1,)
    shares: of coefficients that shapes state
    """

    columns: Array
    precision: Array
    pull: Array
    slopes: tuple[ShapeSlope, ...]
    ends: Index
    shares: tuple[StatedShare, ...] = ()

    def of_term(self, fit: Fit, index: int) -> list[int]:
        """Return the places of all columns of a term: its coefficients', slopes and discrepancies."""
        return [*self.of_law(fit, index), *range(self.ends[index], self.ends[index + 1])]

    def of_law(self, fit: Fit, index: int) -> list[int]:
        """Return the places of the columns of a term's law: its coefficients' and slopes."""
        coefficients = fit.of_term(index)
        shapes = [len(fit.columns) + place for place, slope in enumerate(self.slopes) if slope.term == index]
        return [*range(coefficients.start, coefficients.stop), *shapes]


def linearised(equations: NormalEquations, fit: Fit) -> Linearisation:
    """Return the linearisation of a fit."""
    columns = list(equations.design.in_time(columns_on_wheels(equations, fit.columns)))
    slopes = []
    for slope, column in _shape_slopes(equations, fit):
        slopes.append(slope)
        columns.append(column)
    shape = equations.problem.mask.shape
    discrepancies = [discrepancy_basis(equations, fit, index) for index in range(len(fit.terms))]
    sizes = [len(basis) for basis in discrepancies]
    each = np.full(sum(sizes), equations.thresholds.discrepancy_std**-2)
    each = np.concatenate((np.zeros(len(columns)), each))
    each[: len(equations.nuisance.columns)] = equations.nuisance.precision
    pull = np.zeros_like(each)
    for place, slope in enumerate(slopes, len(fit.columns)):
        each[place], pull[place] = _prior_of_shape(fit.terms[slope.term], slope)
    precision = np.diag(each)
    shares = tuple(_stated_shares(equations, fit, slopes, len(each)))
    for stated in shares:
        precision += np.outer(stated.along, stated.along) / stated.std**2
        pull += (1 - stated.share) / stated.std**2 * stated.along
    stacked = np.stack(columns) if columns else np.zeros((0, *shape))
    ends = len(columns) + np.cumsum([0, *sizes])
    return Linearisation(np.concatenate((stacked, *discrepancies)), precision, pull, tuple(slopes), ends, shares)


def _prior_of_shape(term: Term, slope: ShapeSlope) -> tuple[float, float]:
    """Return the prior precision of a slope's coefficient, and the slope of its log prior where the fit stands."""
    priors = term.group.candidate.shape_priors if term.group.candidate else {}
    if slope.name not in priors:
        return 0.0, 0.0
    mean, std = priors[slope.name]
    away = mean - float(term.group.shape[slope.name])
    return 1 / (std * slope.scale) ** 2, away / (std**2 * slope.scale)


def _stated_shares(
    equations: NormalEquations, fit: Fit, slopes: Sequence[ShapeSlope], count: int
) -> Iterator[StatedShare]:
    """Yield the share of what its shape states that each term's coefficient is, where one states it."""
    for index, term in enumerate(fit.terms):
        candidate, shape = term.group.candidate, term.group.shape
        stated = candidate.stated_coefficient(shape) if candidate else None
        if candidate is None or stated is None:
            continue
        (place,) = range(*fit.of_term(index).indices(len(fit.columns)))
        scale = float(equations.design.scale[term.group.columns[0]])
        share = float(fit.coefficients[place]) / scale / stated[0]
        along = np.zeros(count)
        along[place] = 1 / (scale * stated[0])
        for column, slope in enumerate(slopes, len(fit.columns)):
            if slope.term == index:
                value = float(shape[slope.name])
                longer = candidate.stated_coefficient({**shape, slope.name: value * (1 + SMALL_STEP)})
                rise = (longer[0] - stated[0]) / (SMALL_STEP * value) if longer else 0.0
                along[column] = -share * rise / (stated[0] * slope.scale)
        yield StatedShare(share, stated[1], along)


def _shape_slopes(equations: NormalEquations, fit: Fit) -> Iterator[tuple[ShapeSlope, Array]]:
    """Yield the prediction's slope with each shape parameter that is no change point, shape (time, wheel)."""
    problem, design = equations.problem, equations.design
    for index, term in enumerate(fit.terms):
        candidate, shape = term.group.candidate, term.group.shape
        if candidate is None:
            continue
        values = fit.coefficients[fit.of_term(index)] / design.scale[list(term.group.columns)]
        for name, (low, high) in candidate.continuous(problem, shape).items():
            if name not in shape or name == candidate.change_point:
                continue
            reach = max(0.5 * equations.thresholds.slope_step * (high - low), candidate.resolution(problem))
            ends = max(float(shape[name]) - reach, low), min(float(shape[name]) + reach, high)
            behind, ahead = (columns_of(problem, candidate, {**shape, name: end}) for end in ends)
            slope = np.einsum("c,ctw->tw", values, ahead - behind) / (ends[1] - ends[0])
            on = np.zeros(slope.shape[1])
            on[list(term.wheels)] = 1
            slope = np.where(problem.mask, slope, 0.0) * on
            scale = float(np.sqrt(np.mean(slope**2)))
            if scale > 0:
                yield ShapeSlope(index, name, scale), slope / scale


@dataclass(frozen=True, eq=False)
class Sandwich:
    """How far all of a linearisation would move from where it stands, and how well that is known.

    Attributes
    ----------
    step: how far each column's coefficient would move, shape (column,)
    covariance: A⁻¹ B A⁻¹, shape (column, column)
    matrix, inverse: A, the information and the priors' precision, and A⁻¹
    errors: moments of the columns with draws of the inputs' errors that last, shape (draw, column)
    """

    step: Array
    covariance: Array
    matrix: Array
    inverse: Array
    errors: Array


def sandwich(equations: NormalEquations, fit: Fit, linearisation: Linearisation, blocks: Index) -> Sandwich:
    """Return the sandwich of a fit.

    The fit's own coefficients are at their optimum, priors included, and do not move; what was not fitted does.
    """
    design, precision, weights = equations.design, linearisation.precision, equations.weights
    columns = design.whitened_in_time(linearisation.columns)
    information = np.einsum("atw,w,btw->ab", columns, weights, columns, optimize=True)
    matrix = information + precision
    inverse = pseudo_inverse(matrix, SINGULAR)
    errors = moments_of_errors(design, weights, columns)
    columns *= design.in_time(whitened_residual_of(equations, fit)) * weights  # in place: they may be 20 MB
    sums = block_sums(columns, blocks)
    count = int(blocks.max()) + 1
    middle = sums.T @ sums * count / max(count - 1, 1) + precision
    middle += covariance_of_scores(errors)
    fitted = np.arange(len(information)) < len(fit.columns)
    pull = np.where(fitted, 0.0, sums.sum(axis=0)) + linearisation.pull
    return Sandwich(inverse @ pull, inverse @ middle @ inverse, matrix, inverse, errors)


def block_sums(scores: Array, blocks: Index) -> Array:
    """Return the scores' sums over each block of each wheel, shape (block × wheel, column): independent draws."""
    sums = np.add.reduceat(scores, np.flatnonzero(np.diff(blocks, prepend=-1)), axis=1)
    return sums.transpose(1, 2, 0).reshape(-1, len(scores))
