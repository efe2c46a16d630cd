"""Means of readings that follow each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def running_mean(values: Array, length: int) -> Array:
    """Return the means of so many readings that follow each other, each set of them."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray((total[length:] - total[:-length]) / length)


def block_means(values: Array, length: int) -> Array:
    """Return the means of blocks of so many readings (…, reading); what is left at the end is in none."""
    blocks = values.shape[-1] // length
    return np.asarray(values[..., : blocks * length].reshape(*values.shape[:-1], blocks, length).mean(axis=-1))
