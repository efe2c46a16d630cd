"""What a channel's readings know of the simulation's parameters beside all that was found, its shapes included.

A parameter depends on the exponent of a drag law beside it, and on how inexact that law is, as on the drag's
coefficient: with the shapes held where they were fitted, an interval of it would be several times too narrow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.uncertainty.intervals import drawn_from
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.likelihood.lasting_errors import covariance_of_scores
from regolithd.calibration.mismatch.regression.normal_equations import information_of_some
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.inference.uncertainty.intervals import Drawn
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

SINGULAR = 1e-12
"""Relative eigenvalue below which a direction counts as undetermined (double precision; the priors are in the sum)."""


def drawn_for(decision: Decision) -> Drawn | None:
    """Return draws of the named effects and of all that was fitted with them; None where nothing is named."""
    equations, named = decision.equations, decision.named
    if not named.terms:
        return None
    return drawn_from(equations, named, blocks_of_time(equations.problem, decision.noise))


def parameter_covariance(decision: Decision, drawn: Drawn | None) -> Array:
    """Return the covariance of all coefficients of the decision's fit, shape (column, column); parameters come first.

    Beside curves that nothing names, the shapes of named laws are held: parameters are no finding there.
    """
    equations, fit = decision.equations, decision.whole
    if drawn is None or decision.unnamed:
        inverse, errors = fit.covariance, equations.moments_of_errors(fit.columns)
    else:
        inverse, errors = pseudo_inverse(_matrix(decision, drawn), SINGULAR), drawn.sandwich.errors
    return inverse + covariance_of_scores(errors @ inverse)


def parameter_information(decision: Decision, drawn: Drawn | None, kept: Sequence[int]) -> tuple[Array, Array]:
    """Return information matrix and vector of the free parameters at `kept`, of the readings alone.

    As `NormalEquations.information` has them, with the shapes of the laws free as well.
    """
    equations, fit = decision.equations, decision.whole
    if drawn is None or decision.unnamed:
        return equations.information(fit.terms, kept)
    matrix = _matrix(decision, drawn)
    # The fit is the optimum of readings and priors, the shapes included: these do not move.
    moment = matrix[:, : len(fit.columns)] @ fit.coefficients
    return information_of_some(matrix, moment, drawn.sandwich.errors, equations.nuisance, kept, SINGULAR)


def _matrix(decision: Decision, drawn: Drawn) -> Array:
    """Return the matrix of the linearisation; that of the fit's own columns is summed in double precision."""
    equations, size = decision.equations, len(decision.whole.columns)
    beyond = np.array(drawn.linearisation.precision[:size, :size])  # of coefficients that shapes state
    for place, precision in enumerate(equations.nuisance.precision):
        beyond[place, place] -= precision
    matrix = drawn.sandwich.matrix.copy()
    matrix[:size, :size] = equations.normal_matrix(decision.whole.terms) + beyond
    return matrix
