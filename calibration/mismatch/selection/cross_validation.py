"""Cross-validation of a named effect: whether its Δχ² comes back on folds that did not fit it.

On stationary data a cross-validated Δχ² is the one in sample less about two for each coefficient. Where far less comes
back, the coefficient differs from run to run: the effect belongs to an occasion, not to the machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations, normal_equations
from regolithd.calibration.mismatch.regression.residuals import residual_as_read_of
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import without_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.regression.group import Fit, Term

Array = NDArray[np.float64]


def squares_left(equations: NormalEquations, fit: Fit, fold: int) -> Array:
    """Return the sum of squared errors of a fit on a fold, shape (wheel,)."""
    design = equations.design
    left = residual_as_read_of(equations, fit)
    return np.asarray(np.sum(left[:, design.cuts[fold] : design.cuts[fold + 1]] ** 2, axis=1))


def squares_on_fold(design: DesignMatrix, fit: Fit, fold: int) -> Array:
    """Return the sum of squared errors of a fit on a fold, whitened, shape (wheel,)."""
    total = design.energy[fold].copy()
    for w in range(len(total)):
        on = [(c, v) for (c, wheels), v in zip(fit.columns, fit.coefficients, strict=True) if w in wheels]
        if not on:
            continue
        at = [c for c, _ in on]
        values = np.array([v for _, v in on])
        total[w] += values @ design.products(at, at)[fold, w] @ values - 2 * values @ design.moment[fold, w, at]
    return total


def other_folds(design: DesignMatrix, fold: int) -> list[int]:
    """Return all folds but one; that one where there is no other."""
    return [f for f in range(design.folds) if f != fold] or [fold]


def training_equations(equations: NormalEquations, fold: int) -> NormalEquations:
    """Return the normal equations of all folds but one."""
    design = equations.design
    return normal_equations(design, equations.nuisance, equations.weights, other_folds(design, fold))


def gains_on_other_folds(equations: NormalEquations, terms: Sequence[Term], index: int) -> Array:
    """Return a term's Δχ² on each fold when the other folds fitted it, shape (fold,)."""
    rest = [term for i, term in enumerate(terms) if i != index]
    gains = np.zeros(equations.design.folds)
    for fold in range(len(gains)):
        train = training_equations(equations, fold)
        less = squares_on_fold(train.design, without_terms(train, [terms[index]], rest), fold)
        saved = less - squares_on_fold(train.design, train.fit(terms), fold)
        gains[fold] = float(np.sum(saved * equations.weights))
    return gains


def transfer_margin(equations: NormalEquations, terms: Sequence[Term], index: int, entry_threshold: float) -> float:
    """Return by how much a term passes the test of transfer; negative: it does not.

    A share of its Δχ² must come back. Where folds are whole runs, the other runs must suffice for entry without the
    best of them: an effect that depends on one run is none of the machine.
    """
    limits, design = equations.thresholds, equations.design
    rest = [term for i, term in enumerate(terms) if i != index]
    gains = gains_on_other_folds(equations, terms, index)
    # Of a gain that the priors alone pay (a parameter need not stray), no data can give anything back: only what the
    # data gained is asked for.
    without, fit = without_terms(equations, [terms[index]], rest), equations.fit(terms)
    gained = sum(
        float((squares_on_fold(design, without, fold) - squares_on_fold(design, fit, fold)) @ equations.weights)
        for fold in range(len(gains))
    )
    expected_loss = limits.coefficient_cost * len(terms[index].group.columns)
    found = float(gains.sum()) + expected_loss - limits.transferred_share * gained
    if len(np.unique(equations.problem.recording.run)) < len(gains):
        return found
    return min(found, float(gains.sum() - gains.max()) - entry_threshold - equations.penalty(terms[index]))


def drop_what_does_not_transfer(equations: NormalEquations, named: Fit, entry_threshold: float) -> Fit:
    """Return the fit without terms that do not transfer; the worst is left out first, then all are tested again."""
    while named.terms:
        margins = [transfer_margin(equations, named.terms, index, entry_threshold) for index in range(len(named.terms))]
        worst = int(np.argmin(margins))
        if margins[worst] >= 0:
            break
        named = equations.fit(named.without(worst))
    return named
