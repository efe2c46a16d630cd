"""Scrub while the machine turns: wheels slide sideways, and the two sides work against each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

HALVES = {"rate": (0.3, 1.0, 100.0), "angle": (0.3, 1.0, 3.0)}
"""Where scrub has reached half of what it can, in multiples of the typical turn's."""


class TurningResistance(Candidate):
    """Two parts: drag against each wheel's own rotation, and the moment that outer wheels push and inner ones brake."""

    name = "turning-resistance"
    covariate = "yaw_rate"
    equation = "ΔI = a g(|ψ̇|) sign(ω) + m g(|ψ̇|) sign(ψ̇) side,  g rising"
    words = "scrub while the rover turns"
    signature = "a residual only while turning: alike on all wheels (drag) or opposite on the two sides (moment)"
    experiment = "turn on the spot and along arcs of several radii, both ways"
    source = "skid-steer terramechanics: lateral friction saturates within a few degrees of side slip"
    requires = ("yaw_rate", "direction")
    acts_unloaded = False
    coefficients: ClassVar = (Coefficient("drag", "{unit}", 0), Coefficient("moment", "{unit}", 0))
    sharing: ClassVar = ("all",)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Proportional or saturating with yaw rate, or with the slip angle: on all rows alike, or more at the ends."""
        ends = (0.0, 0.5, 1.0) if problem.row is not None and np.ptp(problem.row) > 1 else (0.0,)
        by = ("rate", "angle") if "wheel_speed" in problem.covariates else ("rate",)
        # An angle cannot grow without end, a rate may.
        return [{"half_at": h, "ends": end, "by": b} for b in by for h in HALVES[b] for end in ends]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return drag and moment, in multiples of what the typical turn has."""
        yaw = np.nan_to_num(problem.covariates["yaw_rate"])
        noise = problem.simulation.sensors.get("yaw_rate_rad_s")
        # What is within the sensor's error of no turn is no turn: its sign would be noise.
        yaw = np.where(np.abs(yaw) > 3 * noise.absolute, yaw, 0.0) if noise else yaw
        turned = np.abs(yaw) * self._lever(problem, float(shape["ends"]))
        if shape["by"] == "angle":
            # Where a wheel points is off from where it goes by yaw rate × lever over its speed.
            speed = np.abs(np.nan_to_num(problem.covariates["wheel_speed"]))
            turned = turned / (speed + 0.1 * np.mean(speed[problem.mask]))
        typical = float(np.mean(turned[yaw != 0])) if np.any(yaw != 0) else 1.0
        relative = turned / typical
        half = float(shape["half_at"])
        size = relative * (1 + half) / (relative + half)
        drag = size * problem.covariates["direction"]
        if problem.side is None:
            return drag[None]
        return np.stack((drag, size * np.sign(yaw) * problem.side))

    def _lever(self, problem: Problem, ends: float) -> Array | float:
        """Return how far each wheel's row is swept sideways by a turn, over its mean: `ends` 1 leaves the middle be."""
        if problem.row is None:
            return 1.0
        away = np.abs(problem.row - np.mean(problem.row))
        return 1 - ends + ends * away / max(float(np.mean(away)), 1e-9)
