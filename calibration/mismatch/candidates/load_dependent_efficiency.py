"""Losses that depend on the torque carried: gears that are less efficient at some loads than at others."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import (
    SHAPE_TOLERANCE,
    UNLIKELY_SHAPE_PENALTY,
    Array,
    Candidate,
    Coefficient,
    Shape,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


class LoadDependentEfficiency(Candidate):
    """An efficiency that is not one number: the loss grows as a power of the torque.

    With power 0 the loss is proportional to torque: the stated efficiency is wrong by more than its stated
    uncertainty. A loss that does not grow with torque at all is Coulomb friction. Or the stated efficiency holds at the
    mean torque and falls or rises in proportion to what is above it: then the current is I/(1 − a x).
    """

    name = "load-dependent-efficiency"
    covariate = "torque"
    equation = "ΔI = a I_sim |I_sim/Ī|^p,  or I_sim (1/(1 − a x) − 1) with x = |I_sim|/Ī − 1"
    words = "a loss that depends on the torque carried"
    signature = "a residual along the predicted current, curved against it"
    experiment = "repeat at one speed with and without ballast, and up and down a slope"
    source = "CSF-11 efficiency over load (maker's chart): 0.3 to 0.7 from a tenth of rated torque to rated"
    requires = ("torque",)
    coefficients: ClassVar = (Coefficient("relative_loss", "1", 0),)

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """From proportional to strongly curved, losses at light loads, and an efficiency that is right on the mean."""
        curved: list[Shape] = [{"power": p} for p in (0.0, 0.5, 1.0, 2.0, 3.5)]
        light: list[Shape] = [{"light": s} for s in (0.5, 1.0)]
        bent: list[Shape] = [{"bent": b} for b in (-0.2, 0.0, 0.3)]
        return [*curved, *light, *bent]

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:
        """Bend the current by the fitted loss, as far as the gears keep a third of their efficiency."""
        if "bent" not in shape:
            return shape
        above = self._relative(problem)[problem.mask] - 1
        least, most = 2 / 3 / min(float(np.min(above)), -1e-9), 2 / 3 / max(float(np.max(above)), 1e-9)
        bent = float(np.clip(values[0], least, most))
        return shape if abs(bent - float(shape["bent"])) <= SHAPE_TOLERANCE * abs(bent) else {"bent": bent}

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:  # noqa: ARG002
        """Charge a loss in proportion: it is the stated gain far outside its own doubt."""
        return UNLIKELY_SHAPE_PENALTY if shape.get("power") == 0.0 else 0.0

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the loss as a multiple of the prediction."""
        relative = self._relative(problem)
        if "bent" in shape:
            above = relative - 1
            return (problem.filled * above / (1 - float(shape["bent"]) * above))[None]
        if "light" in shape:
            return (problem.filled * np.exp(-relative / float(shape["light"])))[None]
        return (problem.filled * relative ** float(shape["power"]))[None]

    def _relative(self, problem: Problem) -> Array:
        """Return the predicted current over its mean magnitude, shape (time, wheel)."""
        size = np.abs(problem.filled)
        return size / max(float(np.mean(size[problem.mask])), 1e-30)
