"""The noise as it is: its size on each wheel, how long it remembers, and the blocks in which it may be taken as new."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
