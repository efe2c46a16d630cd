"""Turning resistance: wheels scrub sideways, and the two sides work against each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

HALVES = {"rate": (0.3, 1.0, 100.0), "angle": (0.3, 1.0, 3.0)}
"""Turn at which the effect has half its limit, in multiples of the reference turn, which is the mean one of the
recording in which the effect is identified (a choice: saturated to proportional)."""
ENDS = (0.0, 0.5, 1.0)
"""How much more the end rows scrub than the middle one: 0 alike, 1 the middle not at all (a choice)."""
NO_TURN_STD = 3.0
"""A yaw rate within this many standard errors is no turn: its sign would be noise."""
CREEP_SHARE = 0.1
"""Share of the mean speed that is added to the speed below a slip angle, which else has no limit (a choice)."""


class TurningResistance(Candidate):
    """Drag against each wheel's own rotation, and a moment: the outer side drives more, the inner one less.

    g grows with the yaw rate, or with the slip angle (the yaw rate over the speed), in proportion or up to a limit.
    """

    name = "turning-resistance"
    covariate = "yaw_rate"
    equation = "Δy = a g(|ψ̇|) sign(ω) + m g(|ψ̇|) sign(ψ̇) side,  g rising"
    words = "scrub of the wheels while the machine turns"
    signature = "a residual only while turning: alike on all wheels (drag) or opposite on the two sides (moment)"
    experiment = "turn on the spot and along arcs of several radii, both ways"
    vary: ClassVar = ("yaw_rate", "direction")
    source = "skid-steer terramechanics: lateral friction saturates within a few degrees of side slip"
    requires = ("yaw_rate", "direction")
    loads = True
    forms = ("over the yaw rate", "over the slip angle")
    acts_unloaded = False
    shape_keys: ClassVar = {
        "by": "what g grows with: `rate`, or slip `angle`",
        "half_at": "where g is half its limit, in reference turns",
        "ends": "how far the wheels at both ends turn more than those in the middle: 0 alike, 1 with their distance",
        "reference_turn": "mean rate (angle) in the recording in which it was found, where g is 1",
        "creep_speed": "added to the speed in the slip angle",
    }
    coefficients: ClassVar = (Coefficient("drag", "{unit}", 0), Coefficient("moment", "{unit}", 0))
    sharing: ClassVar = ("all",)

    def form_of(self, shape: Shape) -> str:
        """Return what the scrub grows with."""
        rate, angle = self.forms
        return rate if shape["by"] == "rate" else angle

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return saturating laws of yaw rate or slip angle, on all rows alike or more at the ends."""
        ends = ENDS if problem.row is not None and np.ptp(problem.row) > 1 else (0.0,)
        by = ("rate", "angle") if "wheel_speed" in problem.covariates else ("rate",)
        # A rate has no limit, an angle has one: its grid has no proportional law.
        return [
            {"half_at": half, "ends": end, "by": b, **self._reference(problem, b, end)}
            for b in by
            for end in ends
            for half in HALVES[b]
        ]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return drag and moment, relative to those of the reference turn; drag alone where there are no sides."""
        yaw = _turning(problem)
        relative = self._turn(problem, shape) / float(shape["reference_turn"])
        half = float(shape["half_at"])
        size = relative * (1 + half) / (relative + half)
        drag = size * problem.covariates["direction"]
        if problem.side is None:
            return drag[None]
        return np.stack((drag, size * np.sign(yaw) * problem.side))

    def _reference(self, problem: Problem, by: str, ends: float) -> Shape:
        """Return what the law is scaled by: the mean turn here, and the speed that limits a slip angle."""
        shape: Shape = {"by": by, "ends": ends}
        if by == "angle":
            speed = np.abs(problem.covariates["wheel_speed"])[problem.mask]
            shape["creep_speed"] = CREEP_SHARE * float(np.nanmean(speed))
        turned = self._turn(problem, shape)[problem.mask & (_turning(problem) != 0)]
        return {**shape, "reference_turn": float(np.mean(turned)) if turned.size else 1.0}

    def _turn(self, problem: Problem, shape: Shape) -> Array:
        """Return the size of the yaw rate, or of the slip angle, that each wheel meets, shape (time, wheel)."""
        turned = np.abs(_turning(problem)) * self._lever(problem, float(shape["ends"]))
        if shape["by"] == "rate":
            return np.asarray(np.broadcast_to(turned, problem.mask.shape))
        # The slip angle is yaw rate × lever over the speed.
        speed = np.abs(problem.known("wheel_speed"))
        return np.asarray(turned / (speed + float(shape["creep_speed"])))

    def _lever(self, problem: Problem, ends: float) -> Array | float:
        """Return each row's distance from the centre over its mean, mixed with 1 by `ends` (0: 1 for every row)."""
        if problem.row is None:
            return 1.0
        away = np.abs(problem.row - np.mean(problem.row))
        return 1 - ends + ends * away / max(float(np.mean(away)), 1e-9)


def _turning(problem: Problem) -> Array:
    """Return the yaw rate, 0 where it is no more than the sensor's noise, shape (time, wheel)."""
    yaw = problem.known("yaw_rate")
    noise = problem.simulation.sensors.get("yaw_rate_rad_s")
    return np.where(np.abs(yaw) > NO_TURN_STD * noise.absolute, yaw, 0.0) if noise else yaw
