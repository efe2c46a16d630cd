"""Smooth terms that act on a state of the simulation: a heat flow, a leak or a force over a covariate.

They show in the readings for as long as the state remembers (`problem/state/state_memory.py`). Beside curves that act
on the reading itself, they tell of which covariate that is which was left out of a balance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import bridged
from regolithd.calibration.mismatch.problem.state.state_memory import memory_s, through_state
from regolithd.calibration.mismatch.regression.groups.smooth_groups import (
    as_followed,
    couplings_of,
    has_smooth_term,
    varies_with_time,
    with_group,
)
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

Array = NDArray[np.float64]

ON_STATE = "on a state"
"""Coupling of these terms."""


def with_state_terms(design: DesignMatrix) -> DesignMatrix:
    """Add, over each covariate and time, a smooth term that acts on a state; nothing where the simulation has none.

    It acts as drag where the machine has a direction, and else as it is.
    """
    problem = design.problem
    memory = memory_s(problem)
    if memory == 0:
        return design
    limits = problem.thresholds
    for name, values in problem.covariates.items():
        if not has_smooth_term(problem, name) or not varies_with_time(problem, values):
            continue
        followed, factor = acting_on_state(problem, name)
        knots = limits.state_time_knots if name == "time" else limits.curve_knots
        hats = hat_functions(followed, np.isfinite(followed), knots)
        columns = [through_state(problem, hat * factor, memory) for hat in hats]
        design = with_group(design, name, columns, ON_STATE)
    return design


def acting_on_state(problem: Problem, covariate: str) -> tuple[Array, Array]:
    """Return a covariate as such a term follows it, and the factor by which that acts, shape (time, wheel) each.

    A state remembers what was before a blank: both have straight lines across blanks.
    """
    couplings = couplings_of(problem)
    factor = couplings["drag" if "drag" in couplings else "offset"]
    return bridged(as_followed(covariate, problem.covariates[covariate])), np.nan_to_num(bridged(factor))
