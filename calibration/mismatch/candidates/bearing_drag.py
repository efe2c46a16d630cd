"""Drag of one wheel that grows from an onset on: a failing bearing, sand in a seal."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.growth import (
    GROWTH_KEYS,
    GROWTH_POWERS,
    GROWTHS,
    growth,
    growth_form,
    growth_ranges,
    onset_grid,
    onset_range,
)
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS, along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

RISES = (0.03, 0.15)
"""Time constants of the exponential rises, as shares of the recording (a choice: quick and slow)."""
POWERS, FURTHER_POWERS = (0.25, 0.5, 2.0), (0.12, 0.18, 0.35, 0.7, 1.4)
"""Powers of the time since the onset that are searched, and those that its interval takes in too (a choice: running-in
wear slows down, spalling accelerates)."""


class BearingDrag(Candidate):
    """Coulomb drag on one wheel, absent before its onset, constant or growing after it.

    g is 0 before the onset. After it, it is a step to 1, an exponential approach to 1, or a power of the time since the
    onset that is 1 at the end of the recording: `drag_current` is the drag at the end.

    On a machine with one axis the onset alone tells it from Coulomb friction, which is the same from the first reading
    on. Both may be named: the friction that was always there, and the drag that was added to it.
    """

    name = "bearing-drag"
    covariate = "time"
    equation = "Δy = y_b g(t − t_0) sign(ω)"
    words = "drag that was not there at first"
    signature = "one wheel's residual along sign(ω), none before its onset, growing after"
    experiment = "repeat the beginning of what was recorded as it was"
    run_unloaded = True
    source = "reports of seal and bearing failures: from some percent of rated current up to stalling"
    requires = ("direction",)
    once_begun = "coulomb-friction"
    parameter_labels: ClassVar = {"drag_current": "drag"}
    loads = True
    forms = GROWTHS
    coefficients: ClassVar = (Coefficient("drag_current", "{unit}"),)
    sharing: ClassVar = ("one",)
    shape_keys: ClassVar = {**GROWTH_KEYS, **REVERSAL_KEYS}
    free: ClassVar = {"onset_s": (0.0, float("inf"))}
    refined: ClassVar = {"rise_s": (0.0, float("inf")), "power": GROWTH_POWERS}

    def form_of(self, shape: Shape) -> str:
        """Return how the drag grows after its onset."""
        return growth_form(shape)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """For each onset: a step, two exponential rises, and growth by a power of the time since the onset."""
        at = onset_grid(problem)
        rises = (0.0, *(share * problem.length_s for share in RISES))
        rising: list[Shape] = [{"onset_s": t, "rise_s": rise} for t in at for rise in rises]
        wear: list[Shape] = [{"onset_s": t, **_wear(problem, p)} for t in at for p in (1.0, *POWERS)]
        return [{**reversal_of(problem), **shape} for shape in (*rising, *wear)]

    def onset_profiles(self, problem: Problem) -> Sequence[Shape]:
        """Add more powers of time than the search has: the onset's interval depends on how the drag grows after it."""
        further = [{**reversal_of(problem), **_wear(problem, power)} for power in FURTHER_POWERS]
        return [*super().onset_profiles(problem), *further]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return sign(ω) g(t − t_0)."""
        return (along_motion(problem, shape) * growth(problem, shape))[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return the recording without its ends: drag must be seen without and with the fault."""
        return {"onset_s": onset_range(problem)}

    def refinable(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range of the time constant, or of the power of time."""
        return growth_ranges(problem, shape)


def _wear(problem: Problem, power: float) -> Shape:
    """Return growth by a power of the time since the onset, which is 1 at the end of this recording."""
    return {"full_at_s": problem.length_s, "power": power}
