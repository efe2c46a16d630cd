"""One wheel's drag grows from some time on: a bearing that fails, sand in a seal."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch.candidates.candidate import (
    Array,
    Candidate,
    Coefficient,
    Shape,
    growth_since,
    onset_grid,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


class BearingDrag(Candidate):
    """Drag against one wheel's rotation that was not there before."""

    name = "bearing-drag"
    covariate = "time"
    equation = "ΔI = I_b g(t − t_0) sign(ω)"
    words = "drag that was not there before"
    signature = "one wheel's residual along sign(ω), none before its onset, growing after"
    experiment = "drive back over the same ground, and lift the wheels and spin all six at one speed"
    source = "seal and bearing failures: from percents of rated current to stalling"
    requires = ("direction",)
    coefficients: ClassVar = (Coefficient("drag_current", "{unit}"),)
    sharing: ClassVar = ("one",)
    free: ClassVar = {"onset_s": (0.0, float("inf"))}

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """At each of many times: at once, within minutes, or on and on, slower or faster with time."""
        at = onset_grid(problem)
        rises = (0.0, 0.03 * problem.length_s, 0.15 * problem.length_s, float("inf"))
        soon: list[Shape] = [{"onset_s": t, "rise_s": rise} for t in at for rise in rises]
        wear: list[Shape] = [{"onset_s": t, "rise_s": float("inf"), "power": p} for t in at for p in (0.25, 0.5, 2.0)]
        return [*soon, *wear]

    def onset_profiles(self, problem: Problem) -> Sequence[Shape]:
        """Add wear by more powers of time than are worth a search: an onset is only as sure as what follows it."""
        wear: list[Shape] = [{"rise_s": float("inf"), "power": p} for p in (0.12, 0.18, 0.35, 0.7, 1.4)]
        return [*super().onset_profiles(problem), *wear]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sign(ω) g(t − t_0)."""
        grown = growth_since(problem, float(shape["onset_s"]), float(shape["rise_s"])) ** float(shape.get("power", 1.0))
        return (problem.covariates["direction"] * grown)[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Anywhere but at the very ends."""
        return {"onset_s": (0.01 * problem.length_s, 0.97 * problem.length_s)}
