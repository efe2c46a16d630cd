"""How long a state of the simulation remembers an input: from its response to changes that are independent.

What a simulation leaves out of a balance (of heat, of volume, of momentum) acts on a state and shows in the readings
for as long as that remembers it. The response of a state of first order falls by the same factor at each reading.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.tangents.principal_axes import switches
from regolithd.calibration.mismatch.signal.intermittency.means import running_mean
from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

SHARE = 0.1
"""Size of the changes, in standard deviations of the input (a choice: small beside it, and far above rounding)."""
NOW, BEFORE = slice(1, None), slice(None, -1)
PARTS = 8
"""Means of readings in the time that a state remembers, of which what acted on it is taken back (a choice: of single
readings it would be noise alone, and means of the whole time would not show spells that are as short)."""
RANK = 1e-6
"""Relative singular value below which columns are dependent: without a state, the response is the change."""
SHORTEST, LONGEST = 2.0, 0.2
"""Readings, and share of the recording, between which a memory is told from none and from a drift (a choice)."""


def memory_s(problem: Problem) -> float:
    """Return the time constant of the simulation's response to its inputs [s]; 0 where it has no state.

    0 as well where that is so long that what acts on it would be a drift.
    """
    memory = longest_memory_s(problem)
    return memory if memory < LONGEST * problem.length_s else 0.0


def longest_memory_s(problem: Problem) -> float:
    """Return the same, however long it is."""
    # Copies of a problem share what was run once.
    return float(problem.run_once("memory of a state", 0.0, lambda: np.array(_memory(problem))))


def _memory(problem: Problem) -> float:
    """Return the same.

    One run, in which all inputs change a little at each instant by lot. The response is regressed on the changes at its
    instant and at the one before, and on itself there: a state keeps that share of what it was. What switches keeps no
    such share.
    """
    if any(switches(problem, name) for name in problem.free):
        return 0.0
    inputs, random = complete_inputs(problem.recording), np.random.default_rng(0)
    changes = {}
    for name in problem.simulation.inputs:
        if name in inputs and (spread := float(np.nanstd(inputs[name]))) > 0:
            changes[name] = SHARE * spread * random.choice([-1.0, 1.0], size=(len(inputs[name]), 1))
    if not changes:
        return 0.0
    try:
        moved = problem.with_inputs({name: inputs[name] + change for name, change in changes.items()})
    except SimulationError:  # it accepts no other inputs than those recorded
        return 0.0
    response = np.nan_to_num(moved - problem.filled)
    kept = _share_kept(response, list(changes.values()), np.diff(problem.recording.run) == 0)
    if not np.exp(-1 / SHORTEST) < kept < 1:
        return 0.0
    return -problem.recording.step_s / float(np.log(kept))


def _share_kept(response: Array, changes: list[Array], same_run: NDArray[np.bool_]) -> float:
    """Return the coefficient of a response (time, wheel) at the instant before, beside the changes of the inputs."""
    wheels, power = response.shape[1], float(np.mean(response**2))
    if power == 0:
        return 0.0
    columns = [response[:-1], *(np.repeat(each[rows], wheels, axis=1) for each in changes for rows in (NOW, BEFORE))]
    scaled = np.stack([column[same_run].ravel() / np.sqrt(np.mean(column**2) + 1e-300) for column in columns], axis=1)
    target = response[1:][same_run].ravel() / np.sqrt(power)
    return float(np.linalg.lstsq(scaled, target, rcond=RANK)[0][0])


def through_state(problem: Problem, column: Array, memory: float) -> Array:
    """Return what a state with this memory [s] shows of what acts on it, shape (time, wheel): a filter of gain 1."""
    recording = problem.recording
    steps = np.diff(recording.time_s, prepend=recording.time_s[0])[:, None]
    same_run = np.diff(recording.run, prepend=recording.run[0])[:, None] == 0
    keeps = np.where(same_run, np.exp(-np.maximum(steps, 0.0) / memory), 0.0)
    return recursion(keeps, (1 - keeps) * column)


def before_state(problem: Problem, shown: Array, memory: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return what acted on a state with this memory [s] for it to show a course, and where that is known.

    Both have the shape (time, wheel). It is the reverse of `through_state`, of means over a part of the memory that
    follow each other, at the last reading of each.
    """
    recording = problem.recording
    length = max(int(memory / recording.step_s / PARTS), 1)
    kept = float(np.exp(-length * recording.step_s / memory))
    acted, known = np.zeros(shown.shape), np.zeros(shown.shape, bool)
    later = slice(2 * length - 1, None)
    if len(shown) < 2 * length:
        return acted, known
    same_run = recording.run[later] == recording.run[: len(shown) - 2 * length + 1]
    for wheel in range(shown.shape[1]):
        means = running_mean(shown[:, wheel], length)
        acted[later, wheel] = (means[length:] - kept * means[:-length]) / (1 - kept)
        read = running_mean(problem.mask[:, wheel].astype(np.float64), 2 * length)
        known[later, wheel] = same_run & (read > 1 - 0.5 / (2 * length))
    ends = np.arange(len(shown)) % length == length - 1
    return acted, known & ends[:, None]
