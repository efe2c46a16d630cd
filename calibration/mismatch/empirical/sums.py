"""Sums of products in fine bins of a covariate: all that a function of that covariate needs to be fitted.

A function f of one covariate x enters the prediction as f(x) times a factor. Within a bin that is narrow against every
change of f it is one number, so that its sums of products with the residual, with the other columns and with itself are
linear and quadratic in the values of f in the bins. Once the recording has been summed, a curve or a closed form costs
as much as its number of bins, whatever the number of rows; and likewise on the folds of a cross-validation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting
from regolithd.calibration.mismatch.regression.likelihood.as_read import columns_on_wheels, long_run_weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POINTS = 24
"""Bins of a picture (a choice: one for each knot of a curve)."""
BINS = 240
"""Bins of the covariate (a choice: a tenth of the width between the knots of a curve)."""


@dataclass(frozen=True, eq=False)
class CovariateSums:
    """Sums over the readings of each fold and wheel; "other columns" are the free parameters' and the named effects'.

    Attributes
    ----------
    at: the covariate's mean in each bin, shape (bin,)
    readings: in each bin, on the curve's wheels, shape (bin,)
    power, moment: of the factor with itself and with the residual, shape (fold, wheel, bin)
    cross: of the factor with the other columns, shape (fold, wheel, bin, column)
    gram, column_moment: of the other columns, and with the residual, shape (fold, wheel, column[, column])
    energy, counts: of the residual with itself, and readings, shape (fold, wheel)
    precision, centre: of the other columns' priors, 0 for effects, shape (column,)
    weights: one over the long-run variance of the noise, shape (wheel,)
    """

    at: Array
    readings: Array
    power: Array
    moment: Array
    cross: Array
    gram: Array
    column_moment: Array
    energy: Array
    counts: Array
    precision: Array
    centre: Array
    weights: Array

    @property
    def folds(self) -> tuple[int, ...]:
        """All folds."""
        return tuple(range(len(self.energy)))

    def other_folds(self, fold: int) -> list[int]:
        """Return all folds but one; that one where there is no other."""
        return [other for other in self.folds if other != fold] or [fold]


@dataclass(frozen=True, eq=False)
class Profile:
    """The log likelihood as a function of the values in the bins, the other columns fitted beside them.

    For values g its gain over g = 0 is, in Δχ², 2 gᵀ moment − gᵀ matrix g.

    Attributes
    ----------
    matrix, moment: shape (bin, bin) and (bin,)
    normal, against: normal matrix and moment of the other columns, shape (column, column) and (column,)
    cross: weighted sums of products of the bins with them, shape (bin, column)
    """

    matrix: Array
    moment: Array
    normal: Array
    against: Array
    cross: Array

    def others(self, values: Array) -> Array:
        """Return the other columns' coefficients beside these values in the bins."""
        return np.asarray(np.linalg.solve(self.normal, self.against - values @ self.cross), np.float64)


def sums_of(equations: NormalEquations, beside: Fit, term: Term, whole: Fit) -> CovariateSums:
    """Return the sums for a smooth term's covariate and factor, on its wheels, beside a fit.

    What `whole`, the fit with the term, leaves is the noise: what `beside` alone leaves has the term's own course in
    it, whose long memory would be taken for the noise's.
    """
    design, weights = equations.design, long_run_weights(equations, whole)
    columns, residual = columns_on_wheels(equations, beside.columns), design.residual_as_read.astype(np.float64)
    values, factor = _course(equations, term)
    at, index = _bins(values, factor != 0)
    folds, wheels, bins = len(design.cuts) - 1, len(weights), len(at)
    power, moment = np.zeros((folds, wheels, bins)), np.zeros((folds, wheels, bins))
    cross = np.zeros((folds, wheels, bins, len(columns)))
    gram = np.zeros((folds, wheels, len(columns), len(columns)))
    column_moment = np.zeros((folds, wheels, len(columns)))
    energy = np.zeros((folds, wheels))
    for fold, (a, b) in enumerate(zip(design.cuts[:-1], design.cuts[1:], strict=True)):
        for w in term.wheels:
            here, by = index[w, a:b], factor[w, a:b]
            power[fold, w] = np.bincount(here, by**2, bins)
            moment[fold, w] = np.bincount(here, by * residual[w, a:b], bins)
            for k, column in enumerate(columns):
                cross[fold, w, :, k] = np.bincount(here, by * column[w, a:b], bins)
        part, left = columns[:, :, a:b], residual[:, a:b]
        gram[fold] = np.einsum("pwt,qwt->wpq", part, part, optimize=True)
        column_moment[fold] = np.einsum("pwt,wt->wp", part, left)
        energy[fold] = np.sum(left**2, axis=1)
    beyond = np.zeros(len(columns) - len(equations.nuisance.columns))
    readings = np.bincount(index[factor != 0], minlength=bins).astype(np.float64)
    return CovariateSums(
        at=at,
        readings=readings,
        power=power,
        moment=moment,
        cross=cross,
        gram=gram,
        column_moment=column_moment,
        energy=energy,
        counts=design.counts,
        precision=np.concatenate((equations.nuisance.precision, beyond)),
        centre=np.concatenate((equations.nuisance.centre, beyond)),
        weights=weights,
    )


def profile(sums: CovariateSums, folds: Sequence[int] | None = None) -> Profile:
    """Return the profile likelihood of the values in the bins on some folds; on all where none are given."""
    on = list(sums.folds if folds is None else folds)

    def weigh(values: Array) -> Array:
        return np.asarray(np.tensordot(sums.weights, values[on].sum(axis=0), 1))

    normal = weigh(sums.gram) + np.diag(sums.precision)
    # Columns that are zero on these folds have no coefficient.
    normal[np.diag_indices_from(normal)] += np.where(np.diag(normal) > 0, 1e-9 * np.diag(normal), 1.0)
    against = weigh(sums.column_moment) + sums.precision * sums.centre
    cross, power, moment = weigh(sums.cross), weigh(sums.power), weigh(sums.moment)
    solved = np.linalg.solve(normal, np.column_stack((cross.T, against)))
    return Profile(
        matrix=np.diag(power) - cross @ solved[:, :-1],
        moment=moment - cross @ solved[:, -1],
        normal=normal,
        against=against,
        cross=cross,
    )


@dataclass(frozen=True, eq=False)
class Points:
    """Means in bins of the covariate with their standard errors, shape (bin,) each."""

    at: Array
    mean: Array
    standard_error: Array


def points_beside(sums: CovariateSums, others: Array) -> Points:
    """Return what the other columns, with these coefficients, leave of the residual, over the factor, in wider bins."""
    left = np.einsum("w,fwb->b", sums.weights, sums.moment - sums.cross @ others)
    power = np.einsum("w,fwb->b", sums.weights, sums.power)
    parts = np.array_split(np.flatnonzero(power > 0), min(POINTS, int(np.count_nonzero(power))))
    known = np.array([power[part].sum() for part in parts])
    at = np.array([np.average(sums.at[part], weights=sums.readings[part]) for part in parts])
    return Points(at, np.array([left[part].sum() for part in parts]) / known, 1 / np.sqrt(known))


def squares_on_fold(sums: CovariateSums, fold: int, values: Array, others: Array) -> Array:
    """Return the sum of squared errors on a fold, shape (wheel,), for values in the bins and other coefficients."""
    own = np.sum(values * (sums.power[fold] * values - 2 * sums.moment[fold]), axis=1)
    beside = np.einsum("wpq,p,q->w", sums.gram[fold], others, others) - 2 * sums.column_moment[fold] @ others
    between = 2 * np.einsum("b,wbp,p->w", values, sums.cross[fold], others)
    return np.asarray(sums.energy[fold] + own + beside + between)


def _course(equations: NormalEquations, term: Term) -> tuple[Array, Array]:
    """Return covariate and factor, shape (wheel, time) in the order of folds; the factor is 0 where it does not act."""
    problem, group = equations.problem, term.group
    values, by = acting(problem, group.name, group.coupling)
    on = np.isin(np.arange(values.shape[1]), list(term.wheels))
    acts = problem.mask & np.isfinite(values) & on
    factor = np.where(acts, by, 0.0)
    order = equations.design.order
    return np.where(acts, values, 0.0).T[:, order], factor.T[:, order]


def _bins(values: Array, acts: NDArray[np.bool_]) -> tuple[Array, Index]:
    """Return the mean of the values that act in each bin, and each value's bin."""
    inside, shares = values[acts], np.linspace(0, 1, BINS + 1)[1:-1]
    low, high = float(inside.min()), float(inside.max())
    # Halfway between bins of equal numbers and of equal widths.
    between = 0.5 * (np.quantile(inside, shares) + low + (high - low) * shares)
    index = np.searchsorted(between, values)
    used, places = np.unique(index[acts], return_inverse=True)
    at = np.bincount(places, inside) / np.bincount(places)
    return at, np.clip(np.searchsorted(used, index), 0, len(used) - 1)
