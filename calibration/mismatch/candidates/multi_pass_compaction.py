"""Multi-pass effect: later wheels run in the ruts of earlier ones, on compacted soil."""

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

KEPT = (0.0, 0.5, 1.0)
"""Change by each further pass over that by the first (tests: most of it by the first pass)."""
FORMS = {
    "current": "in proportion to the prediction",
    "stiffness": "of the soil's stiffness",
    "soil": "of stiffness, shear modulus and cohesion",
}
"""Names of what a pass changes, in the answer."""
STEP = 0.3
"""Relative change of stiffness and shear modulus of the prediction's difference quotient (a choice: as in a rut)."""


STIFFNESS: tuple[str, tuple[str, ...]] = ("stiffness_factor", ("k_c_", "k_phi_"))
SHEAR: tuple[str, tuple[str, ...]] = ("shear_factor", ("shear_modulus_m",))
"""The variant of a simulation by which soil is stiffer, or shears more; else its parameters, whose names begin so."""
COHESION = "cohesion_Pa"


class MultiPassCompaction(Candidate):
    """A change of the current or of the soil that depends on the number of earlier passes.

    `by` says what a pass changes: the current, the soil's stiffness, or stiffness, shear modulus and cohesion. `kept`
    is the change by each further pass over that by the first; `leads` the end from which passes are counted.
    """

    name = "multi-pass-compaction"
    covariate = "wheel_row"
    equation = "Δy = p(row) (a y_sim),  or p(row) Σ a_k ∂y_sim/∂ln k over the soil's stiffness, shear modulus, cohesion"
    words = "soil that earlier wheels have compacted for later ones"
    signature = "a residual along the predicted current that is the same for both wheels of a row and differs by row"
    experiment = "drive one virgin lane, then twice more in the same ruts"
    source = "multi-pass tests on sand: most of the compaction in the first pass"
    requires = ("torque",)
    needs = (
        "wheels one behind the other (row of the simulation); for the forms of the soil, its parameters k_c_… or "
        "k_phi_…, shear_modulus_m and cohesion_Pa"
    )
    acts_unloaded = False
    forms = tuple(FORMS.values())
    shape_keys: ClassVar = {
        "by": "what a pass changes: `current`, `stiffness` or `soil`",
        "kept": "change by each further pass over that by the first",
        "leads": "the end from which passes are counted: `front`, or that which leads in the direction of `travel`",
    }
    coefficients: ClassVar = (
        Coefficient("relative_change_per_pass", "1", 0),
        Coefficient("relative_shear_modulus_per_pass", "1", 0),
        Coefficient("relative_cohesion_per_pass", "1", 0),
    )
    sharing: ClassVar = ("all",)

    def form_of(self, shape: Shape) -> str:
        """Return what a pass changes."""
        return FORMS[str(shape["by"])]

    def applies(self, problem: Problem) -> bool:
        """Return whether the machine has rows of wheels."""
        return super().applies(problem) and problem.row is not None and bool(np.ptp(problem.row) > 0)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return compaction from the first pass alone to equal in each, counted from the front or the leading end."""
        leads = ("front", "travel") if "direction" in problem.covariates else ("front",)
        ways = ["current"]
        stiffness, shear = (_has(problem, *each) for each in (STIFFNESS, SHEAR))
        ways += ["stiffness"] if stiffness else []
        ways += ["soil"] if stiffness and shear and COHESION in problem.values else []
        return [{"kept": kept, "leads": lead, "by": way} for kept in KEPT for lead in leads for way in ways]

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:  # noqa: ARG002
        """Charge the form with three coefficients: mostly one explains a rut."""
        return UNLIKELY_SHAPE_PENALTY if shape["by"] == "soil" else 0.0

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the prediction, or its derivatives with respect to the soil's parameters, times the earlier passes."""
        assert problem.row is not None  # noqa: S101  # applies() asks for rows
        last = np.max(problem.row)
        passes = np.broadcast_to(problem.row, problem.mask.shape)
        if shape["leads"] == "travel":
            passes = np.where(problem.covariates["direction"] >= 0, passes, last - passes)
        # Each further pass adds the fraction k of the change by the first one.
        kept = float(shape["kept"])
        done = np.where(passes > 0, 1.0, 0.0) + np.where(passes > 1, kept * (passes - 1), 0.0)
        if shape["by"] == "current":
            return (problem.filled * done)[None]
        stiffer = _relative_change(problem, *STIFFNESS, STEP)
        if shape["by"] == "stiffness":
            return (stiffer * done)[None]
        coheres = problem.values[COHESION] * problem.tangent(COHESION)
        return np.stack((stiffer * done, _relative_change(problem, *SHEAR, -STEP) * done, coheres * done))


def _has(problem: Problem, variant: str, parameters: tuple[str, ...]) -> bool:
    """Return whether a simulation has a variant by which it changes, or a parameter whose name begins so."""
    return variant in problem.simulation.variants() or any(name.startswith(parameters) for name in problem.values)


def _relative_change(problem: Problem, variant: str, parameters: tuple[str, ...], step: float) -> Array:
    """Return the prediction's change per relative change of a variant, or of all parameters that begin so."""
    if variant in problem.simulation.variants():
        return problem.secant(variant, step)
    names = [name for name in problem.values if name.startswith(parameters)]
    return np.sum([problem.values[name] * problem.tangent(name) for name in names], axis=0)
