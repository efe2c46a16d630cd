"""Blocks of time in which the noise may be taken as independent, and the folds of a cross-validation made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.signal.noise import NoiseModel

Index = NDArray[np.int64]


def blocks_of_time(problem: Problem, noise: NoiseModel) -> Index:
    """Return each instant's block, shape (time,).

    A block is long against the noise's autocorrelation time, and short enough that every fold has several. No block
    holds instants of two runs.
    """
    limits, step_s = problem.thresholds, problem.recording.step_s
    wanted_s = limits.block_autocorrelation_times * noise.autocorrelation_time * step_s
    wanted_s = np.clip(wanted_s, limits.shortest_block_s, limits.longest_block_s)
    longest_s = problem.length_s / (limits.blocks_per_fold * limits.folds)
    length_s = min(wanted_s, max(longest_s, 2 * step_s))
    number = np.floor(problem.time_s[:, 0] / length_s).astype(np.int64)
    pairs = np.stack((problem.recording.run, number), axis=1)
    return np.unique(pairs, axis=0, return_inverse=True)[1].ravel()


def folds_of_blocks(problem: Problem, blocks: Index) -> Index:
    """Return each instant's fold, shape (time,): whole runs where there are enough, else every fifth block."""
    folds = problem.thresholds.folds
    runs = np.unique(problem.recording.run)
    if len(runs) >= folds:
        return np.searchsorted(runs, problem.recording.run) % folds
    return blocks % folds
