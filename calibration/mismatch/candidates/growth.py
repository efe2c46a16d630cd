"""What begins at a time: its onset, and how it grows after that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Array, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

ONSET_COUNT = 24
"""Onsets in the grid of a candidate (a choice: one in each 4 % of the recording, refined later)."""
EARLIEST_ONSET, LATEST_ONSET = 0.05, 0.95
"""Ends of that grid, as shares of the recording: what is before and after an onset must both be seen (a choice)."""
FIRST_ONSET, LAST_ONSET = 0.05, 0.97
"""Range of the optimised onset, as shares of the recording (a choice): what is there from the start is no change."""


def onset_grid(problem: Problem, count: int = ONSET_COUNT) -> list[float]:
    """Return times at which something may begin [s], evenly spread over the recording without its ends."""
    return [float(t) for t in problem.length_s * np.linspace(EARLIEST_ONSET, LATEST_ONSET, count)]


def onset_range(problem: Problem) -> tuple[float, float]:
    """Return the times between which an onset is optimised [s]: what was before it and after it must be seen."""
    return FIRST_ONSET * problem.length_s, LAST_ONSET * problem.length_s


GROWTH_KEYS = {
    "onset_s": "when it begins in the course that fits best; `parameters.onset_s` is the median of all courses",
    "rise_s": "time constant of the exponential rise (0: a step)",
    "full_at_s": "when the power of time is 1",
    "power": "of the time since the onset",
}
"""What the keys of a shape with a `growth` mean."""
GROWTHS = ("step", "exponential rise", "power of time")
"""Names of the forms that `growth` has."""


LONGEST_RISE, SHORTEST_RISE = 1.0, 0.002
"""Ends of the time constant of a rise, as shares of the recording (a choice: one that is longer is a ramp, and one that
is shorter a step)."""
GROWTH_POWERS = (0.1, 2.0)
"""Ends of the power of the time since the onset (a choice: a lower one is a step, and a higher one, from an earlier
onset, is like any growth)."""


def growth_ranges(problem: Problem, shape: Shape) -> dict[str, tuple[float, float]]:
    """Return the range of the number that tells how something grows after its onset; of a step there is none."""
    if "full_at_s" in shape:
        return {"power": GROWTH_POWERS} if "power" in shape else {}
    return {"rise_s": (SHORTEST_RISE * problem.length_s, LONGEST_RISE * problem.length_s)} if shape["rise_s"] else {}


def growth_form(shape: Shape) -> str:
    """Return which of `GROWTHS` a shape has."""
    step, rise, power = GROWTHS
    if "full_at_s" in shape:
        return power
    return rise if shape["rise_s"] else step


def growth(problem: Problem, shape: Shape) -> Array:
    """Return growth from 0 at the shape's `onset_s`, shape (time, 1).

    With `full_at_s`, by a `power` of the time since the onset, and 1 at that time; with `rise_s`, an exponential
    approach to 1 with that time constant, and a step where it is 0.
    """
    onset_s = float(shape["onset_s"])
    after = np.maximum(problem.time_s - onset_s, 0.0)
    if "full_at_s" in shape:
        relative = after / max(float(shape["full_at_s"]) - onset_s, 1e-9)
        return np.asarray(relative ** float(shape.get("power", 1.0)))
    rise_s = float(shape["rise_s"])
    if rise_s == 0:
        return (problem.time_s >= onset_s).astype(np.float64)
    return -np.expm1(-after / rise_s)
