"""Blocks of time in which the noise may be taken as independent, and the folds of a cross-validation made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.signal.noise import Noise

FOLDS = 5
LONGEST_MEMORY_S = 60.0


def blocks_of_time(problem: Problem, noise: Noise) -> NDArray[np.int64]:
    """Return each instant's block, shape (time,): long against the noise's memory, yet enough of them for folds.

    Runs are never mixed in one block. Blocks of the same number stay together when data are held out.
    """
    step = problem.recording.step_s
    wanted = np.clip(10 * noise.memory * step, 20.0, LONGEST_MEMORY_S)
    wanted = min(wanted, max(problem.length_s / (6 * FOLDS), 2 * step))
    number = np.floor(problem.time_s[:, 0] / wanted).astype(np.int64)
    pairs = np.stack((problem.recording.run, number), axis=1)
    return np.unique(pairs, axis=0, return_inverse=True)[1].ravel()


def folds_of_blocks(problem: Problem, blocks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return each instant's fold, shape (time,): whole runs where there are several, else every fifth block."""
    runs = np.unique(problem.recording.run)
    if len(runs) >= FOLDS:
        return np.searchsorted(runs, problem.recording.run) % FOLDS
    return blocks % FOLDS
