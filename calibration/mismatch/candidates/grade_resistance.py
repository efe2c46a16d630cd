"""Grade resistance: the weight's component along the slope, shared among the wheels."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


class GradeResistance(Candidate):
    """Current in proportion to sin(pitch), whichever way the wheels turn: nose up, traction must act forwards."""

    name = "grade-resistance"
    covariate = "pitch"
    equation = "Δy = k (W/W_ref) sin(pitch)"
    words = "the weight's part along the slope"
    signature = "a residual along sin(pitch) that does not change sign with the direction of travel"
    experiment = "drive one slope up and down, forwards and backwards"
    experiment_one_way = "drive one slope up and down"
    vary: ClassVar = ("pitch", "direction")
    source = "statics: at most weight × radius / gain"
    requires = ("pitch",)
    loads = True
    forms = ("shared evenly", "shared by load")
    along_motion = False
    shape_keys: ClassVar = {
        "shared": "by the wheels: `evenly`, or `by load`",
        "reference_load": "W_ref, the mean load in the recording in which it was found",
    }
    acts_unloaded = False
    parameter_labels: ClassVar = {"grade_current": "grade resistance"}
    coefficients: ClassVar = (Coefficient("grade_current", "{unit}"),)
    sharing: ClassVar = ("all",)

    def form_of(self, shape: Shape) -> str:
        """Return how the wheels share the weight."""
        return f"shared {shape['shared']}"

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return sharing in proportion to each wheel's load over the mean one here, where it is known, or evenly."""
        evenly: Shape = {"shared": "evenly"}
        if "load" not in problem.covariates:
            return [evenly]
        reference = float(np.nanmean(problem.covariates["load"][problem.mask]))
        return [{"shared": "by load", "reference_load": reference}, evenly]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sin(pitch), times each wheel's share of the load relative to the reference."""
        along = np.sin(problem.known("pitch"))
        if shape["shared"] == "by load":
            along = along * problem.known("load") / float(shape["reference_load"])
        return along[None]
