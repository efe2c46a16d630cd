"""Over which quantity a smooth term runs, and by which factor it acts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.regression.smooth_groups import couplings_of

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

EACH_WAY = "each way"
"""Coupling of what acts one way only: a function of the signed speed."""
OF_MAGNITUDE = frozenset({"wheel_speed"})
"""Covariates whose smooth terms are functions of the magnitude, except those that act each way."""
ALONG = "drag, "
"""Beginning of the coupling of a drag that acts oppositely on two parts of the machine."""


def of_magnitude(covariate: str, coupling: str) -> bool:
    """Return whether a smooth term is a function of its covariate's magnitude."""
    return covariate in OF_MAGNITUDE and coupling != EACH_WAY


def factor_of(problem: Problem, covariate: str, coupling: str) -> Array:
    """Return the factor by which a function of a covariate acts on the prediction, shape (time, wheel).

    Raises
    ------
    SimulationError
        When this machine has no such coupling.
    """
    known = couplings_of(problem)
    if coupling in known:
        return known[coupling]
    if coupling == EACH_WAY:
        return known["offset"]
    contrast = problem.contrasts(covariate).get(coupling.removeprefix(ALONG))
    if contrast is None:
        raise SimulationError(f"an empirical curve over {covariate} acts as {coupling!r}, which this machine cannot")
    return known.get("drag", known["offset"]) * contrast
