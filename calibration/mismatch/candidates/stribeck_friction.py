"""Stribeck effect: extra drag near standstill that decays as a lubricating film builds up."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS, TRANSITION, along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


QUOTIENT = "quotient"
"""What `fades` is of the law that is no exponential."""
USUAL_EXPONENTS = (1.0, 2.0)
"""Exponents δ that are searched: of an exponential and of a Gaussian."""
OF_FADES = {"exponent 1": 1.0, "exponent 2": 2.0}
"""The exponents as files of version 0.2.0 name them."""
EXPONENTS = (0.4, 3.0)
"""Ends of the exponent δ: 0.5 to 2 were measured (Bo and Pavelescu, 1982; Armstrong-Hélouvry, 1991), and more where
the film builds up at once."""
STRETCHED = "stretched exponential"
"""The law between the exponential and the Gaussian, and beyond them."""
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
    equation = "Δy = y_s sign(ω) exp(−(|ω|/ω_s)^δ), or y_s sign(ω) / (1 + (ω/ω_s)²)"
    words = "extra drag near standstill that decays with speed"
    signature = "a residual along sign(ω) that is largest at the slowest speeds"
    experiment = "hold at least four values of the {wheel_speed}, from the slowest to the highest, both ways"
    experiment_one_way = "hold at least four values of the {wheel_speed}, from the slowest to the highest"
    vary: ClassVar = ("wheel_speed", "direction")
    source = "Armstrong-Hélouvry, Dupont and Canudas de Wit (1994): δ from 1 to 2; Hess and Soom (1990): the quotient"
    requires = ("wheel_speed",)
    loads = True
    forms = ("exponential", "Gaussian", "quotient", STRETCHED)
    label = "Stribeck friction"
    parameter_labels: ClassVar = {"stribeck_current": "Stribeck friction", "stribeck_speed_rad_s": "Stribeck speed"}
    coefficients: ClassVar = (Coefficient("stribeck_current", "{unit}"),)
    shape_keys: ClassVar = {
        "stribeck_speed_rad_s": "ω_s",
        "exponent": "δ: 1 of an exponential, 2 of a Gaussian",
        "fades": "`quotient`, in the place of an exponent",
        **REVERSAL_KEYS,
    }
    free: ClassVar = {"stribeck_speed_rad_s": (0.0, np.inf)}
    refined: ClassVar = {"exponent": EXPONENTS}

    def form_of(self, shape: Shape) -> str:
        """Return how the drag decays with speed."""
        exponential, gaussian, quotient, stretched = self.forms
        exponent = _exponent(shape)
        return quotient if exponent is None else {1.0: exponential, 2.0: gaussian}.get(exponent, stretched)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return Stribeck speeds between the slowest and half of the highest speed, in three forms.

        Extra drag near standstill looks like a friction that reverses gradually, and the other way about: where the
        recording shows such a transition, both a step and the transition are tried. What decays before the friction
        has reversed is no Stribeck effect: it is a transition of another form.
        """
        transition = reversal_of(problem)
        ways_to_turn: list[Shape] = [{}, transition] if transition else [{}]
        laws: list[Shape] = [{"exponent": exponent} for exponent in USUAL_EXPONENTS]
        laws.append({"fades": QUOTIENT})
        return [
            {**turn, "stribeck_speed_rad_s": float(speed), **law}
            for turn in ways_to_turn
            for law in laws
            for low, high in [self._range(problem, turn)]
            for speed in (np.geomspace(low, high, SPEED_COUNT) if low < high else ())
        ]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sign(ω) times the share of the extra drag that is left at this speed."""
        speed = problem.covariates["wheel_speed"]
        ratio, exponent = np.abs(speed) / float(shape["stribeck_speed_rad_s"]), _exponent(shape)
        left = 1 / (1 + ratio**2) if exponent is None else np.exp(-(ratio**exponent))
        return (along_motion(problem, shape) * left)[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range in which it can be told from nothing, from a transition, and from a constant."""
        return {"stribeck_speed_rad_s": self._range(problem, shape)}

    def _range(self, problem: Problem, shape: Shape) -> tuple[float, float]:
        speed = np.abs(problem.covariates["wheel_speed"][problem.mask])
        speed = speed[speed > 0]
        low, high = (factor * float(np.quantile(speed, quantile)) for factor, quantile in (SLOWEST, FASTEST))
        return max(low, float(shape.get(TRANSITION, 0.0))), high


def _exponent(shape: Shape) -> float | None:
    """Return δ; None: of the quotient, which has none."""
    if "exponent" in shape:
        return float(shape["exponent"])
    return OF_FADES.get(str(shape["fades"]))
