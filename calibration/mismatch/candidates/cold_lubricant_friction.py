"""Drag that grows as the gearbox gets colder: grease stiffens."""

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
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


POLES_DEGC = (-125.0, -95.0)
"""Between which Vogel's law for low-temperature greases has its pole."""
STEEPEST_K = 5.0
"""No grease thins by a factor e, or loses all its drag, within less."""


class ColdLubricantFriction(Candidate):
    """Grease viscosity over temperature: a constant drag or one proportional to speed, times a falling function."""

    name = "cold-lubricant-friction"
    covariate = "temperature"
    equation = "ΔI = I_cold g(T) sign(ω) |ω|^p,  g falling with T"
    words = "drag that grows as the gearbox gets colder"
    signature = "a residual along sign(ω) that shrinks as the motor warms"
    experiment = "start cold, warm up, stop until cold again and repeat, so that temperature does not follow time"
    source = "Vogel–Fulcher viscosity of low-temperature greases: a factor e in 10 to 40 K; linear in a small range"
    requires = ("temperature", "direction")
    parameter_labels: ClassVar = {"scale_K": "temperature scale"}
    coefficients: ClassVar = (Coefficient("cold_drag", "{unit} (s/rad)^p"),)
    free: ClassVar = {"scale_K": (STEEPEST_K, 80.0), "no_drag_above_degC": (-60.0, 80.0)}

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Vogel's law of several steepnesses, and straight lines that end at several temperatures."""
        temperature = problem.covariates["temperature"][problem.mask]
        soonest = _coldest(problem) + STEEPEST_K
        top = max(float(np.nanmax(temperature)), soonest)
        ends = np.unique(np.maximum([*np.nanquantile(temperature, [0.35, 0.6, 0.85]), top], soonest)).tolist()
        found: list[Shape] = []
        for power in (0.0, 1.0):
            found += [
                {"power": power, "pole_degC": pole, "scale_K": scale}
                for pole in POLES_DEGC
                for scale in (6.0, 11.0, 20.0, 45.0)
            ]
            found += [{"power": power, "no_drag_above_degC": end} for end in (*ends, top + 20)]
        return found

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:
        """Charge a drag that no wheel's own temperature changes: Coulomb and viscous friction are the plainer names."""
        return 0.0 if problem.changes_within(self._growth(problem, shape)) else UNLIKELY_SHAPE_PENALTY

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return g(T) sign(ω)|ω|^p; g is 1 at the coldest that was driven."""
        drag = problem.covariates["direction"] * self._growth(problem, shape)
        if float(shape["power"]) and "wheel_speed" in problem.covariates:
            drag = drag * np.abs(problem.covariates["wheel_speed"])
        return drag[None]

    def _growth(self, problem: Problem, shape: Shape) -> Array:
        """Return g(T), shape (time, wheel)."""
        temperature = np.nan_to_num(problem.covariates["temperature"])
        coldest = _coldest(problem)
        if "scale_K" in shape:
            # Vogel: ln of viscosity goes with 1/(T − T_0); near the coldest it falls by e over the scale.
            pole = float(shape["pole_degC"])
            above, coldest_above = np.maximum(temperature - pole, 5.0), max(coldest - pole, 5.0)
            return np.asarray(np.exp(coldest_above / float(shape["scale_K"]) * (coldest_above / above - 1)))
        end = float(shape["no_drag_above_degC"])
        return np.maximum(end - temperature, 0.0) / max(end - coldest, STEEPEST_K)

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Only the parameter that this shape has."""
        temperature = problem.covariates["temperature"][problem.mask]
        soonest = max(float(np.nanquantile(temperature, 0.2)), _coldest(problem) + STEEPEST_K)
        ends = (soonest, max(float(np.nanmax(temperature)), soonest) + 40)
        return {"scale_K": self.free["scale_K"]} if "scale_K" in shape else {"no_drag_above_degC": ends}


def _coldest(problem: Problem) -> float:
    """Return the coldest that was driven [°C], single readings aside."""
    return float(np.nanquantile(problem.covariates["temperature"][problem.mask], 0.005))
