"""Blocks of time in which the noise may be taken as independent, and the folds of a cross-validation made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel

Index = NDArray[np.int64]

SHORTEST_BLOCK = 2.0
"""Readings in a block at least: of a single one there is no mean."""
ROUNDING = 1e-6
"""Blocks by which an instant may be off, so that the unit of time does not move it into the next one."""


def blocks_of_time(problem: Problem, noise: NoiseModel) -> Index:
    """Return each instant's block, shape (time,).

    A block is long against the noise's autocorrelation time, and short enough that every fold has several. Its length
    is counted in readings: no second is built in. No block holds instants of two runs.
    """
    limits, readings = problem.thresholds, problem.time_s[:, 0] / problem.recording.step_s
    wanted = limits.block_autocorrelation_times * noise.autocorrelation_time
    shortest, longest = readings[-1] / limits.most_blocks, readings[-1] / (limits.blocks_per_fold * limits.folds)
    length = max(float(np.clip(wanted, shortest, longest)), SHORTEST_BLOCK)
    number = np.floor(readings / length + ROUNDING).astype(np.int64)
    in_order = problem.recording.run * (number.max() + 1) + number
    return np.unique(in_order, return_inverse=True)[1].ravel()


def folds_of_blocks(problem: Problem, blocks: Index) -> Index:
    """Return each instant's fold, shape (time,): whole runs where there are enough, else every fifth block."""
    folds = problem.thresholds.folds
    runs = np.unique(problem.recording.run)
    if len(runs) >= folds:
        return np.searchsorted(runs, problem.recording.run) % folds
    return blocks % folds
