"""A curve of a fleet: a piecewise linear function of a covariate that several recordings have in common.

As the smooth terms of one recording (`regression.groups.smooth_groups`), it stands for no known physics. Its knots are
the same in all recordings, so that sums of products add up, and it has one size wherever it acts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient
from regolithd.calibration.mismatch.problem.state.state_memory import longest_memory_s, through_state
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE, acting_on_state
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions_at
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]


def memory_of(problem: Problem) -> float:
    """Return the memory of a simulation's state [s]; 0 where it has none, or one that is longer than the recording.

    In one recording what acts on a state that remembers a fifth of it looks like a drift. In several it does not.
    """
    memory = longest_memory_s(problem)
    return memory if memory < problem.length_s else 0.0


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
        memory = memory_of(problem) if coupling == ON_STATE else 0.0
        if over not in problem.covariates or (coupling == ON_STATE and memory == 0):
            return np.zeros((0, *problem.mask.shape))
        at = np.linspace(float(shape["low"]), float(shape["high"]), len(self.coefficients))
        if coupling == ON_STATE:
            followed, factor = acting_on_state(problem, over)
            hats = hat_functions_at(followed, np.isfinite(followed), at)
            return np.stack([through_state(problem, hat * factor, memory) for hat in hats])
        followed, factor = acting(problem, over, coupling)
        return np.stack(hat_functions_at(followed, problem.mask, at)) * factor
