"""What a law may be wrong by: no law of friction or soil is nature's to the last percent.

Kennedy and O'Hagan (2001) put a discrepancy beside a model and let the data and a prior share it out. Here each effect
may be larger or smaller than its law along its covariate, and from wheel to wheel, by a share with a standard
deviation of `FORM`: it widens the intervals where the data leave it open, and is measured where they do not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.residuals import contribution
from regolithd.calibration.mismatch.signal.hat_basis import broken_lines

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search

Array = NDArray[np.float64]

FORM = 0.15
"""Standard deviation of an effect's share by which its law is wrong, at each knot and on each wheel."""
KNOTS = 6
CONSTANT = frozenset({"direction", "none"})
"""What is said to be constant may be wrong in just that: it is bent along time."""
WITHOUT_A_FORM = frozenset({"wheel_row", "wheel_angle"})
"""Covariates along which there is no law that could be wrong."""


def bends(search: Search, fit: Fit, index: int) -> Array:
    """Return how one effect would change were its law wrong by its whole self, shape (bend, time, wheel)."""
    problem, term = search.dictionary.problem, fit.terms[index]
    effect = contribution(search, fit, index)
    found = []
    covariate = term.group.candidate.covariate if term.group.candidate else "none"
    covariate = "time" if covariate in CONSTANT else covariate
    if covariate in problem.covariates and covariate not in WITHOUT_A_FORM:
        values = problem.covariates[covariate]
        values = values if np.nanmin(values) >= 0 or covariate == "temperature" else np.abs(values)
        found += [hat * effect for hat in broken_lines(values, problem.mask & (effect != 0), KNOTS)]
    if len(term.wheels) > 1:
        found += [effect * (np.arange(effect.shape[1]) == wheel) for wheel in term.wheels]
    return np.stack(found) if found else np.zeros((0, *effect.shape))
