"""Errors of the inputs that last in the prediction, as what they do to a fit.

A level that a noisy flow fills wanders. The readings do not show how far: a fit follows a part of it, and the rest is
as slow noise of a few independent values. Draws of the prediction's error (`problem/inputs/input_doubt.py`) tell it: a
fit moves by A⁻¹ m, with A its information and m the moments of its columns with a draw. The mean of m mᵀ over the draws
is added to the covariance of the scores, as in a sandwich. A fit with the draws as columns would be sure of whatever a
few draws do not span.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import as_shown

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

Array = NDArray[np.float64]


def has_lasting_errors(problem: Problem) -> bool:
    """Return whether errors of the inputs last in the prediction."""
    return problem.doubt is not None and len(problem.doubt.draws) > 0


def moments_of_errors(design: DesignMatrix, weights: Array, columns: Array) -> Array:
    """Return the weighted moments of whitened columns (column, time, wheel) with each draw, shape (draw, column)."""
    problem = design.problem
    if problem.doubt is None or not len(problem.doubt.draws):
        return np.zeros((0, len(columns)))
    draws = np.stack(as_shown(problem, list(problem.doubt.draws)))
    drawn = design.whitened_in_time(np.where(problem.mask, draws, 0.0))
    return np.asarray(np.einsum("atw,w,dtw->da", columns, weights, drawn, optimize=True))


def covariance_of_scores(moments: Array) -> Array:
    """Return the mean of m mᵀ over draws, shape (column, column); 0 where there are none."""
    return np.asarray(moments.T @ moments / max(len(moments), 1))
