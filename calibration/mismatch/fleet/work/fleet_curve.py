"""A curve of a fleet: a piecewise linear function of a covariate that several recordings have in common.

As the smooth terms of one recording (`regression.groups.smooth_groups`), it stands for no known physics. Its knots are
the same in all recordings, so that sums of products add up, and it has one size wherever it acts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient
from regolithd.calibration.mismatch.candidates.late_columns import bridged
from regolithd.calibration.mismatch.problem.state.state_memory import memory_s, through_state
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting, couplings_of
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions_at
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]


class FleetCurve(Candidate):
    """A piecewise linear function of a covariate, which acts on the predicted channel or on a state of the simulation.

    Its shape says over which covariate (`over`), how it acts (`coupling`, as of a smooth term), and where its outermost
    knots are (`low`, `high`).
    """

    name, covariate = "curve", "none"
    equation, words, signature = "Δy = f(x)", "something without a name", "a residual that follows a covariate"
    experiment, source = "vary the covariate", "no known physics"
    coefficients: ClassVar = tuple(Coefficient(f"knot_{k}", sign=0) for k in range(THRESHOLDS.curve_knots))

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the hat functions of its knots, shape (knot, time, wheel); none without the covariate or a state."""
        over, coupling = str(shape["over"]), str(shape["coupling"])
        memory = memory_s(problem) if coupling == ON_STATE else 0.0
        if over not in problem.covariates or (coupling == ON_STATE and memory == 0):
            return np.zeros((0, *problem.mask.shape))
        at = np.linspace(float(shape["low"]), float(shape["high"]), len(self.coefficients))
        if coupling != ON_STATE:
            values, factor = acting(problem, over, coupling)
            return np.stack(hat_functions_at(values, problem.mask, at)) * factor
        couplings, values = couplings_of(problem), problem.covariates[over]
        factor = np.nan_to_num(bridged(couplings["drag" if "drag" in couplings else "offset"]))
        known = bridged(np.abs(values) if over == "wheel_speed" else values)
        hats = hat_functions_at(known, np.isfinite(known), at)
        return np.stack([through_state(problem, hat * factor, memory) for hat in hats])
