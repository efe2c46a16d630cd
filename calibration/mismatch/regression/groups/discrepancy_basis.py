"""Discrepancy of a law: no law of friction or soil is exact to the last percent.

Kennedy and O'Hagan (2001) put a discrepancy beside a model and let the data and a prior share it out. Here each effect
may be larger or smaller than its law along its covariate, and from wheel to wheel, by a share with the standard
deviation `Thresholds.discrepancy_std`: it widens the intervals where the data leave it open, and is fitted where they
do not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.residuals import contribution
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]

CONSTANT = frozenset({"direction", "none"})
"""Covariates of constant effects: such an effect may be wrong in being constant, and varies along time."""
WITHOUT_A_LAW = frozenset({"wheel_row", "wheel_angle"})
"""Covariates along which no law can be wrong."""


def discrepancy_basis(equations: NormalEquations, fit: Fit, index: int) -> Array:
    """Return the changes of an effect whose law is wrong by its whole size, shape (basis function, time, wheel)."""
    problem, term = equations.problem, fit.terms[index]
    effect = contribution(equations, fit, index)
    values = _covariate(problem, term)
    found = []
    if values is not None:
        hats = hat_functions(values, problem.mask & (effect != 0), problem.thresholds.discrepancy_knots)
        found += [hat * effect for hat in hats]
    if len(term.wheels) > 1:
        found += [effect * (np.arange(effect.shape[1]) == wheel) for wheel in term.wheels]
    return np.stack(found) if found else np.zeros((0, *effect.shape))


def _covariate(problem: Problem, term: Term) -> Array | None:
    """Return what an effect's law depends on, shape (time, wheel); speeds and the like without their sign."""
    name = term.group.candidate.covariate if term.group.candidate else "none"
    name = "time" if name in CONSTANT else name
    if name not in problem.covariates or name in WITHOUT_A_LAW:
        return None
    values = problem.covariates[name]
    return values if np.nanmin(values) >= 0 or name == "temperature" else np.abs(values)
