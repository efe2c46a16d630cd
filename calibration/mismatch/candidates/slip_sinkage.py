"""Slip sinkage: a slipping wheel sinks deeper (Eq. 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import SHAPE_TOLERANCE, Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


LEAST_STRENGTH, LARGEST_STRENGTH = 0.05, 3.0
"""Strengths for which the soil model is run (a choice: Lyasko's is 1; below a twentieth it acts in proportion)."""


class SlipSinkage(Candidate):
    """Lyasko's factor on the sinkage, by way of the simulation's soil model where it has one."""

    name = "slip-sinkage"
    covariate = "slip"
    equation = "z_SS = z (1 + s ((1 + i)/(1 − i/2) − 1))  (Eqs 8, 9)"
    words = "extra sinkage with slip"
    signature = "a residual along the predicted current that grows with slip and vanishes without it"
    experiment = "pull a sledge of several weights on level ground, so that slip changes at constant load"
    source = "Lyasko (2010), Eq. 8 of the paper: s = 1"
    requires = ("slip",)
    acts_unloaded = False
    forms = ("by the soil model", "in proportion to slip")
    shape_keys: ClassVar = {
        "step": "the strength for which the soil model is run",
        "power": "of the slip, for machines without that model",
    }
    coefficients: ClassVar = (Coefficient("strength", "1"),)
    sharing: ClassVar = ("all",)

    def form_of(self, shape: Shape) -> str:
        """Return what the sinkage is computed by."""
        soil_model, proportional = self.forms
        return soil_model if "step" in shape else proportional

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return the soil model at small and full strength, and a law proportional to slip."""
        has_soil = "slip_sinkage" in problem.simulation.variants()
        through: list[Shape] = [{"step": 0.3}, {"step": 1.0}] if has_soil else []
        return [*through, {"power": 1.0}]

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:  # noqa: ARG002
        """Return the shape with the soil model at the fitted strength."""
        if "step" not in shape:
            return shape
        before, strength = float(shape["step"]), float(np.clip(values[0], LEAST_STRENGTH, LARGEST_STRENGTH))
        return shape if abs(strength - before) < SHAPE_TOLERANCE * before else {**shape, "step": strength}

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the change of the prediction for more sinkage per unit of strength, or prediction × slip."""
        if "step" in shape:
            return problem.secant("slip_sinkage", float(shape["step"]))[None]
        slip = np.maximum(problem.known("slip"), 0.0)
        return (problem.filled * slip ** float(shape["power"]))[None]
