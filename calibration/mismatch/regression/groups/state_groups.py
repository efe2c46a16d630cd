"""Smooth terms that act on a state of the simulation: a heat flow, a leak or a force over a covariate.

They show in the readings for as long as the state remembers (`problem/state/state_memory.py`). Beside curves that act
on the reading itself, they tell of which covariate that is which was left out of a balance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.late_columns import bridged
from regolithd.calibration.mismatch.problem.state.state_memory import memory_s, through_state
from regolithd.calibration.mismatch.regression.groups.smooth_groups import (
    couplings_of,
    has_smooth_term,
    varies_with_time,
    with_group,
)
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

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
    couplings, limits = couplings_of(problem), problem.thresholds
    factor = couplings["drag" if "drag" in couplings else "offset"]
    for name, values in problem.covariates.items():
        if not has_smooth_term(problem, name) or not varies_with_time(problem, values):
            continue
        known = bridged(np.abs(values) if name == "wheel_speed" else values)
        knots = limits.state_time_knots if name == "time" else limits.curve_knots
        hats = hat_functions(known, np.isfinite(known), knots)
        columns = [through_state(problem, hat * np.nan_to_num(bridged(factor)), memory) for hat in hats]
        design = with_group(design, name, columns, ON_STATE)
    return design
