"""Stribeck effect: extra drag near standstill that decays as a lubricating film builds up."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS, TRANSITION, along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


FADES: dict[str, Callable[[Array], Array]] = {
    "exponent 1": lambda ratio: np.exp(-ratio),
    "exponent 2": lambda ratio: np.exp(-(ratio**2)),
    "quotient": lambda ratio: 1 / (1 + ratio**2),
}
"""Share of the extra drag that is left, as a function of speed over the Stribeck speed."""
FORMS = {"exponent 1": "exponential", "exponent 2": "Gaussian", "quotient": "quotient"}
"""Names of these laws in the answer."""
SPEED_COUNT = 7
"""Stribeck speeds that are searched, in geometric steps (a choice)."""
SLOWEST, FASTEST = (0.5, 0.02), (0.5, 0.98)
"""Ends of their range, as a factor on a quantile of the speed (a choice): below the first the effect decays before the
slowest reading; above the second more than a fifth of it is left at the highest speed, where it and viscous drag
together pass for Coulomb friction."""


class StribeckFriction(Candidate):
    """Boundary friction above the Coulomb level, negligible at several times the Stribeck speed.

    The parameter is called `stribeck_speed_rad_s` on every machine; its `unit` is that of `wheel_speed`, m/s where the
    machine moves in a line.
    """

    name = "stribeck-friction"
    covariate = "wheel_speed"
    equation = "ΔI = I_s sign(ω) exp(−(|ω|/ω_s)^δ), or I_s sign(ω) / (1 + (ω/ω_s)²)"
    words = "extra drag near standstill that decays with speed"
    signature = "a residual along sign(ω) that is largest at the slowest speeds"
    experiment = "hold at least four values of the {wheel_speed}, from the slowest to the highest, both ways"
    experiment_one_way = "hold at least four values of the {wheel_speed}, from the slowest to the highest"
    vary: ClassVar = ("wheel_speed", "direction")
    source = "Armstrong-Hélouvry, Dupont and Canudas de Wit (1994): δ from 1 to 2; Hess and Soom (1990): the quotient"
    requires = ("wheel_speed",)
    loads = True
    forms = tuple(FORMS.values())
    label = "Stribeck friction"
    parameter_labels: ClassVar = {"stribeck_current": "Stribeck friction", "stribeck_speed_rad_s": "Stribeck speed"}
    coefficients: ClassVar = (Coefficient("stribeck_current", "{unit}"),)
    shape_keys: ClassVar = {
        "stribeck_speed_rad_s": "ω_s",
        "fades": "`exponent 1` (δ = 1, exponential), `exponent 2` (δ = 2, Gaussian) or `quotient`",
        **REVERSAL_KEYS,
    }
    free: ClassVar = {"stribeck_speed_rad_s": (0.0, np.inf)}

    def form_of(self, shape: Shape) -> str:
        """Return how the drag decays with speed."""
        return FORMS[str(shape["fades"])]

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return Stribeck speeds between the slowest and half of the highest speed, in three forms.

        Extra drag near standstill looks like a friction that reverses gradually, and the other way about: where the
        recording shows such a transition, both a step and the transition are tried. What decays before the friction
        has reversed is no Stribeck effect: it is a transition of another form.
        """
        transition = reversal_of(problem)
        ways_to_turn: list[Shape] = [{}, transition] if transition else [{}]
        return [
            {**turn, "stribeck_speed_rad_s": float(speed), "fades": fades}
            for turn in ways_to_turn
            for fades in FADES
            for low, high in [self._range(problem, turn)]
            for speed in (np.geomspace(low, high, SPEED_COUNT) if low < high else ())
        ]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sign(ω) times the share of the extra drag that is left at this speed."""
        speed = problem.covariates["wheel_speed"]
        ratio = np.abs(speed) / float(shape["stribeck_speed_rad_s"])
        return (along_motion(problem, shape) * FADES[str(shape["fades"])](ratio))[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range in which it can be told from nothing, from a transition, and from a constant."""
        return {"stribeck_speed_rad_s": self._range(problem, shape)}

    def _range(self, problem: Problem, shape: Shape) -> tuple[float, float]:
        speed = np.abs(problem.covariates["wheel_speed"][problem.mask])
        speed = speed[speed > 0]
        low, high = (factor * float(np.quantile(speed, quantile)) for factor, quantile in (SLOWEST, FASTEST))
        return max(low, float(shape.get(TRANSITION, 0.0))), high
