"""How long a state of the simulation remembers an input: from its response to changes that are independent.

What a simulation leaves out of a balance (of heat, of volume, of momentum) acts on a state and shows in the readings
for as long as that remembers it. The response of a state of first order falls by the same factor at each reading.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.principal_axes import switches
from regolithd.calibration.mismatch.signal.recursion import recursion

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

SHARE = 0.1
"""Size of the changes, in standard deviations of the input (a choice: small beside it, and far above rounding)."""
LASTING = 0.2
"""Correlation of the response from one reading to the next, from which there is a state (a choice: what each reading
responds by itself has none, and may be added to what a state responds)."""
SHORTEST, LONGEST = 2.0, 0.2
"""Readings, and share of the recording, between which a memory is told from none and from a drift (a choice)."""


def memory_s(problem: Problem) -> float:
    """Return the time constant of the simulation's response to its inputs [s]; 0 where it has no state."""
    return float(problem.once("memory of a state", lambda: np.array(_memory(problem))))


def _memory(problem: Problem) -> float:
    """Return the same.

    One run, in which all inputs change a little at each instant by lot. The correlations of the response one and two
    readings apart have the factor of the state as their quotient, whatever the readings respond beside it. What
    switches has no such factor.
    """
    if any(switches(problem, name) for name in problem.free):
        return 0.0
    inputs, random = complete_inputs(problem.recording), np.random.default_rng(0)
    moved = {}
    for name in problem.simulation.inputs:
        if name in inputs and (spread := float(np.nanstd(inputs[name]))) > 0:
            moved[name] = inputs[name] + SHARE * spread * random.choice([-1.0, 1.0], size=(len(inputs[name]), 1))
    if not moved:
        return 0.0
    response = np.nan_to_num(problem.with_inputs(moved) - problem.filled)
    one, two = (_correlation(response, lag) for lag in (1, 2))
    factor = two / one if one > LASTING else 0.0
    if not np.exp(-1 / SHORTEST) < factor < 1:
        return 0.0
    memory = -problem.recording.step_s / float(np.log(factor))
    return memory if memory < LONGEST * problem.length_s else 0.0


def through_state(problem: Problem, column: Array, memory: float) -> Array:
    """Return what a state with this memory [s] shows of what acts on it, shape (time, wheel): a filter of gain 1."""
    recording = problem.recording
    steps = np.diff(recording.time_s, prepend=recording.time_s[0])[:, None]
    same_run = np.diff(recording.run, prepend=recording.run[0])[:, None] == 0
    keeps = np.where(same_run, np.exp(-np.maximum(steps, 0.0) / memory), 0.0)
    return recursion(keeps, (1 - keeps) * column)


def _correlation(response: Array, lag: int) -> float:
    """Return the correlation of a response (time, wheel) with itself so many readings later."""
    power = float(np.sum(response**2))
    return float(np.sum(response[lag:] * response[:-lag])) / power if power > 0 else 0.0
