"""Later wheels run in the ruts of earlier ones, on soil already compacted."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import (
    UNLIKELY_SHAPE_PENALTY,
    Array,
    Candidate,
    Coefficient,
    Shape,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


class MultiPassCompaction(Candidate):
    """Resistance that changes from row to row, by number of passes before.

    What a pass does to the soil is one number (the current, or the stiffness, changes by so much), or three: a rut is
    stiffer, shears sooner, and coheres more.
    """

    name = "multi-pass-compaction"
    covariate = "wheel_row"
    equation = "ΔI = p(row) (a I_sim),  or p(row) Σ a_k ∂I_sim/∂ln k over the soil's stiffness, shear modulus, cohesion"
    words = "soil that earlier wheels have compacted for later ones"
    signature = "a residual along the predicted current that is the same for both wheels of a row and differs by row"
    experiment = "drive one virgin lane, then twice more in the same ruts"
    source = "multi-pass tests on sand: most of the compaction in the first pass"
    requires = ("torque",)
    acts_unloaded = False
    coefficients: ClassVar = (
        Coefficient("relative_change_per_pass", "1", 0),
        Coefficient("relative_shear_modulus_per_pass", "1", 0),
        Coefficient("relative_cohesion_per_pass", "1", 0),
    )
    sharing: ClassVar = ("all",)

    def applies(self, problem: Problem) -> bool:
        """Only where there are rows."""
        return super().applies(problem) and problem.row is not None and bool(np.ptp(problem.row) > 0)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """All at the first pass, or evenly; counted from the front, or from whichever end leads."""
        leads = ("front", "travel") if "direction" in problem.covariates else ("front",)
        ways = ["current"]
        ways += ["stiffness"] if "stiffness_factor" in problem.simulation.variants() else []
        ways += ["soil"] if {"shear_factor", "cohesion_Pa"} <= {*problem.simulation.variants(), *problem.values} else []
        return [{"kept": kept, "leads": lead, "by": way} for kept in (0.0, 0.5, 1.0) for lead in leads for way in ways]

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:  # noqa: ARG002
        """Charge three numbers for a rut where mostly one will do."""
        return UNLIKELY_SHAPE_PENALTY if shape["by"] == "soil" else 0.0

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the prediction (or its answer to stiffer soil) times what the passes before have done."""
        assert problem.row is not None  # noqa: S101  # applies() said so
        last = np.max(problem.row)
        passes = np.broadcast_to(problem.row, problem.mask.shape)
        if shape["leads"] == "travel":
            passes = np.where(problem.covariates["direction"] >= 0, passes, last - passes)
        # 1 + k + k² …: what each further pass adds is the fraction k of what the one before did.
        kept = float(shape["kept"])
        done = np.where(passes > 0, 1.0, 0.0) + np.where(passes > 1, kept * (passes - 1), 0.0)
        if shape["by"] == "current":
            return (problem.filled * done)[None]
        stiffer = problem.secant("stiffness_factor", 0.3)
        if shape["by"] == "stiffness":
            return (stiffer * done)[None]
        coheres = problem.values["cohesion_Pa"] * problem.tangent("cohesion_Pa")
        return np.stack((stiffer * done, problem.secant("shear_factor", -0.3) * done, coheres * done))
