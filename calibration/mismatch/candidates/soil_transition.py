"""Change of the soil's strength from some time on: the rover drives onto another soil."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.growth import onset_grid

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


BORDERS_M = (0.01, 0.5)
"""Length over which one soil turns into the other [m] (a choice: a line, and a blend of about the rover's length)."""
ONSETS = 40
"""Onsets that are searched (a choice: one in each 2 % of the recording, as a border lies between two wheels)."""
FIRST_ONSET, LAST_ONSET = 0.02, 0.97
"""Range of the optimised onset, as shares of the recording (a choice)."""


class SoilTransition(Candidate):
    """Cohesion and tan φ change by the same factor, from a time on or beyond a place on the track."""

    name = "soil-transition"
    covariate = "time"
    equation = "c, tan φ → (1 + s) c, (1 + s) tan φ  for t > t_0"
    words = "a change of the soil's strength"
    signature = "on all wheels at once, a residual along the predicted current that begins at one time and stays"
    experiment = "drive back over the same ground"
    run_unloaded = True
    source = "Table 1 of the paper: strengths differ by a factor of five between soils"
    acts_unloaded = False
    forms = ("at one time", "at one place")
    needs = "the parameters cohesion_Pa and friction_angle_deg"
    coefficients: ClassVar = (Coefficient("relative_strength_change", "1", 0),)
    sharing: ClassVar = ("all",)
    shape_keys: ClassVar = {
        "onset_s": "when the machine's centre comes to the other soil in the course that fits best; "
        "`parameters.onset_s` is the median of all courses",
        "along": "`time` (under all wheels at once) or `place` (under each when it comes there)",
        "within_m": "length over which one soil turns into the other",
        "of": "what changes: `strength` (both), `cohesion` or `friction`",
    }
    free: ClassVar = {"onset_s": (0.0, float("inf"))}

    def form_of(self, shape: Shape) -> str:
        """Return where the other soil begins: under all wheels at once, or where each of them crosses a border."""
        return f"at one {shape['along']}"

    def applies(self, problem: Problem) -> bool:
        """Return whether the simulation has cohesion and friction angle as parameters."""
        return {"cohesion_Pa", "friction_angle_deg"} <= set(problem.simulation.parameters)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return, for each onset, a change under all wheels at once, or as each wheel crosses the border."""
        return [{"onset_s": t, **way} for t in onset_grid(problem, ONSETS) for way in self.onset_profiles(problem)]

    def onset_profiles(self, problem: Problem) -> Sequence[Shape]:
        """Return a change in time, and where the place is known, along the track at a line or over half a metre."""
        everywhere: Shape = {"along": "time", "of": "strength"}
        if "place" not in problem.covariates:
            return [everywhere]
        borders: list[Shape] = [{"along": "place", "within_m": width, "of": "strength"} for width in BORDERS_M]
        return [everywhere, *borders]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the prediction's derivative with respect to the relative strength, beyond the onset."""
        values = problem.values
        cohesion = values["cohesion_Pa"] * problem.tangent("cohesion_Pa")
        # d tan φ / tan φ = dφ · 2 / sin 2φ; to a few percent the angle itself scales alike.
        friction = values["friction_angle_deg"] * problem.tangent("friction_angle_deg")
        of = {"strength": cohesion + friction, "cohesion": cohesion, "friction": friction}[str(shape["of"])]
        return (of * _beyond(problem, shape))[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return the recording without its ends: both soils must be seen."""
        return {"onset_s": (FIRST_ONSET * problem.length_s, LAST_ONSET * problem.length_s)}


def _beyond(problem: Problem, shape: Shape) -> Array:
    """Return the share of the other soil, shape (time, wheel); the rover's centre crosses the border at the onset."""
    onset_s = float(shape["onset_s"])
    if shape["along"] == "time" or problem.time_s[0, 0] > onset_s:  # all of the recording is beyond the onset
        return np.broadcast_to(problem.time_s >= onset_s, problem.mask.shape).astype(np.float64)
    place = problem.covariates["place"]
    beyond_m = place - np.interp(onset_s, problem.time_s[:, 0], np.mean(place, axis=1))
    return np.clip(0.5 + beyond_m / float(shape["within_m"]), 0.0, 1.0)
