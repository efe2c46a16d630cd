"""The noise as it is: its size on each wheel, how long it remembers, and the blocks in which it may be taken as new."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.simulation.problem import Problem

Array = NDArray[np.float64]

FOLDS = 5
LONGEST_MEMORY_S = 60.0


@dataclass(frozen=True)
class Noise:
    """The residual's noise.

    Attributes
    ----------
    deviation: standard deviation on each wheel, shape (wheel,)
    memory: Σ of the autocorrelation over all lags: how many values count as one, at least 1
    """

    deviation: Array
    memory: float

    @property
    def weights(self) -> Array:
        """One over the long-run variance, for each wheel: what makes a sum of squares a log-likelihood."""
        return 1 / (self.deviation**2 * self.memory)


def estimate_noise(residual: Array, mask: NDArray[np.bool_]) -> Noise:
    """Estimate from a residual that has no structure left, or as little as possible; shape (time, wheel).

    The autocorrelation is pooled over wheels and summed until it first falls into its own uncertainty (Geyer's
    initial sequence): further lags would only add noise.
    """
    clean = np.where(mask, residual, 0.0)
    counts = np.maximum(mask.sum(axis=0), 1)
    deviation = np.sqrt(np.sum(clean**2, axis=0) / counts)
    deviation = np.where(
        deviation > 0, deviation, np.median(deviation[deviation > 0]) if np.any(deviation > 0) else 1.0
    )
    size = 2 ** int(np.ceil(np.log2(2 * len(clean))))
    scaled = np.fft.rfft(clean / deviation, size, axis=0)
    known = np.fft.rfft(mask.astype(np.float64), size, axis=0)
    lags = len(clean) // 10
    products = np.fft.irfft(np.abs(scaled) ** 2, size, axis=0)[:lags].sum(axis=1)
    pairs = np.fft.irfft(np.abs(known) ** 2, size, axis=0)[:lags].sum(axis=1)
    correlation = products / np.maximum(pairs, 1)
    doubt = 2 / np.sqrt(max(float(mask.sum()), 1.0))
    quiet = np.flatnonzero(correlation[1:] < doubt)
    end = int(quiet[0]) + 1 if quiet.size else lags
    return Noise(deviation, float(max(1.0, 1 + 2 * np.sum(correlation[1:end]))))


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
