"""Drag of a lubricant whose viscosity grows as it gets colder."""

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
from regolithd.calibration.mismatch.candidates.celsius import known_temperature_degC, temperature_degC
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS, along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


POWERS = (0.0, 1.0)
"""Power of the speed: from dry contact, or a grease that thins with shear (power-law index 0.1 to 0.5), to an oil."""
POLES_DEGC = (-125.0, -95.0)
"""Pole temperatures of Vogel's law that bracket low-temperature greases [°C] (data sheets)."""
BELOW_COLDEST_K = 15.0
"""How far below the coldest reading a pole that a recording asks for is at least [K] (a choice: an oil is solid some 20
to 60 K above its pole). Poles colder than all others differ little from the coldest of them."""
POLE_STD_K = 20.0
"""Standard deviation of poles about these [K] (a choice: between these and that of mineral oils the mean is 20 K)."""
SCALES_K = (6.0, 11.0, 20.0, 45.0)
"""Temperature changes for a factor e near the coldest reading, as searched [K] (a choice: in steps of about two)."""
STEEPEST_K = 5.0
"""Least temperature change for a factor e, or for the whole drag to vanish [K] (a choice: greases have 10 to 40 K)."""
ABOVE_POLE_K = 5.0
"""Least distance from the pole, where the law has no limit [K] (a choice: no reading is that cold)."""
COLDEST_QUANTILE = 0.005
"""Quantile of the temperature that counts as the coldest, so that single readings do not."""
END_QUANTILES = (0.35, 0.6, 0.85)
"""Quantiles of the temperature at which a linear drag may end (a choice)."""
LOWEST_END_QUANTILE, FURTHEST_END_K = 0.2, 40.0
"""Range of the end of a linear drag: from this quantile to so far above the warmest reading [K] (a choice)."""
BEYOND_K = 20.0
"""A linear drag may end this far above the warmest reading too [K] (a choice)."""
OF_TEMPERATURE = ("reference_degC", "pole_degC", "scale_K", "no_drag_above_degC")
"""The shape parameters of how the drag depends on temperature."""


class ColdLubricantFriction(Candidate):
    """Drag times a falling function of temperature, Vogel's law or a line; with speed it grows by a power from 0 to 1.

    The function is 1 at a reference temperature, the coldest of the recording in which the drag is identified.
    """

    name = "cold-lubricant-friction"
    covariate = "temperature"
    equation = "Δy = y_cold g(T) sign(ω) |ω|^p,  g falling with T"
    words = "drag that grows as the {temperature} falls"
    signature = "a residual along sign(ω) that shrinks as the motor warms"
    experiment = "start cold, warm up, cool down and repeat, so that the {temperature} does not follow the time"
    source = "Vogel–Fulcher viscosity of low-temperature greases: a factor e in 10 to 40 K; linear in a small range"
    requires = ("temperature", "direction")
    loads = True
    forms = ("Vogel's law", "a line")
    parameter_labels: ClassVar = {"scale_K": "temperature scale"}
    coefficients: ClassVar = (Coefficient("cold_drag", "{unit} ({per_speed})^p"),)
    shape_keys: ClassVar = {
        "power": "of the speed",
        "reference_degC": "T_r, where g is 1",
        "pole_degC": "T_p of Vogel's law, g = exp((T_r − T_p)/s ((T_r − T_p)/(T − T_p) − 1))",
        "scale_K": "s, the change of temperature for a factor e near T_r",
        "no_drag_above_degC": "T_e of the line, g = (T_e − T)/(T_e − T_r), 0 above T_e",
        **REVERSAL_KEYS,
    }
    free: ClassVar = {"power": POWERS, "scale_K": (STEEPEST_K, 80.0), "no_drag_above_degC": (-60.0, 80.0)}
    refined: ClassVar = {"pole_degC": (min(POLES_DEGC), 0.0)}

    def form_of(self, shape: Shape) -> str:
        """Return how the drag depends on temperature."""
        vogel, line = self.forms
        return vogel if "scale_K" in shape else line

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return Vogel's law with several scales, and straight lines that end at several temperatures."""
        temperature = temperature_degC(problem)[problem.mask]
        soonest = _coldest(problem) + STEEPEST_K
        top = max(float(np.nanmax(temperature)), soonest)
        ends = np.unique(np.maximum([*np.nanquantile(temperature, END_QUANTILES), top], soonest)).tolist()
        found: list[Shape] = []
        for power in POWERS:
            cold: Shape = {**reversal_of(problem), "power": power, "reference_degC": _coldest(problem)}
            found += [{**cold, "pole_degC": pole, "scale_K": scale} for pole in POLES_DEGC for scale in SCALES_K]
            found += [{**cold, "no_drag_above_degC": end} for end in (*ends, top + BEYOND_K)]
        return found

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:
        """Charge a drag that does not change on any wheel: there Coulomb or viscous friction is the simpler model."""
        law = [shape[name] for name in OF_TEMPERATURE if name in shape]
        changes = problem.once(
            f"the lubricant's drag changes {law}",
            lambda: np.array(problem.changes_within(self._growth(problem, shape))),
        )
        return self._unlikely_pole(shape) + (0.0 if changes else UNLIKELY_SHAPE_PENALTY)

    def _unlikely_pole(self, shape: Shape) -> float:
        """Return the Δχ² by which a pole is less likely than usual ones."""
        pole = float(shape.get("pole_degC", POLES_DEGC[0]))
        beyond = max(pole - max(POLES_DEGC), min(POLES_DEGC) - pole, 0.0)
        return (beyond / POLE_STD_K) ** 2

    def without_covariate(self, shape: Shape) -> Shape:
        """Return the same drag at any temperature, which would gain by its power of the speed alone."""
        kept = {name: value for name, value in shape.items() if name != "no_drag_above_degC"}
        return {**kept, "pole_degC": POLES_DEGC[0], "scale_K": np.inf}

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return g(T) sign(ω)|ω|^p; g is 1 at the reference temperature."""
        drag, power = along_motion(problem, shape) * self._growth(problem, shape), float(shape["power"])
        if power and "wheel_speed" in problem.covariates:
            speed = problem.covariates["wheel_speed"]
            drag = drag * problem.lately(f"speed to the power of {power!r}", lambda: np.abs(speed) ** power)
        return drag[None]

    def _growth(self, problem: Problem, shape: Shape) -> Array:
        """Return g(T), shape (time, wheel)."""
        law = [shape[name] for name in OF_TEMPERATURE if name in shape]
        return problem.lately(f"the lubricant's drag {law}", lambda: self._growth_anew(problem, shape))

    def _growth_anew(self, problem: Problem, shape: Shape) -> Array:
        """Return the same, computed."""
        temperature = known_temperature_degC(problem)
        coldest = float(shape["reference_degC"])
        if "scale_K" in shape:
            # Vogel: ln η = A + B/(T − T_0); near the reference the viscosity falls by a factor e over the scale.
            pole = float(shape["pole_degC"])
            above, coldest_above = np.maximum(temperature - pole, ABOVE_POLE_K), max(coldest - pole, ABOVE_POLE_K)
            return np.asarray(np.exp(coldest_above / float(shape["scale_K"]) * (coldest_above / above - 1)))
        end = float(shape["no_drag_above_degC"])
        return np.maximum(end - temperature, 0.0) / max(end - coldest, STEEPEST_K)

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range of the one parameter that this shape has."""
        temperature = temperature_degC(problem)[problem.mask]
        soonest = max(float(np.nanquantile(temperature, LOWEST_END_QUANTILE)), _coldest(problem) + STEEPEST_K)
        ends = (soonest, max(float(np.nanmax(temperature)), soonest) + FURTHEST_END_K)
        falls = {"scale_K": self.free["scale_K"]} if "scale_K" in shape else {"no_drag_above_degC": ends}
        return {"power": POWERS, **falls} if "wheel_speed" in problem.covariates else falls

    def refinable(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range of the pole, of Vogel's law."""
        warmest = max(_coldest(problem) - BELOW_COLDEST_K, *POLES_DEGC)
        return {"pole_degC": (min(POLES_DEGC), warmest)} if "scale_K" in shape else {}

    def parameters(self, shape: Shape, values: Sequence[float]) -> dict[str, float]:
        """Return what the answer reports: the pole where the recording asked for another one than usual."""
        found = super().parameters(shape, values)
        return {name: value for name, value in found.items() if name != "pole_degC" or value not in POLES_DEGC}

    def search_range(
        self, problem: Problem, shape: Shape, name: str, bounds: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the whole range of the power: the grid has its ends alone."""
        return bounds if name == "power" else super().search_range(problem, shape, name, bounds)


def _coldest(problem: Problem) -> float:
    """Return the coldest temperature [°C], single readings aside."""

    def coldest() -> Array:
        return np.asarray(np.nanquantile(temperature_degC(problem)[problem.mask], COLDEST_QUANTILE))

    return float(problem.once("coldest temperature", coldest))
