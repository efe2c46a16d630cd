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


def local_means(values: Array, used: NDArray[np.bool_], starts: NDArray[np.int64], length: int) -> Array:
    """Return means over so many readings about each (time, column), of those that are used, each run for itself.

    What is not used stays as it is. `length` is odd; `starts` are the instants where a run begins.
    """
    found, half = values.copy(), length // 2
    for rows in np.split(np.arange(len(values)), starts[starts > 0]):
        here = used[rows]
        first = np.maximum(np.arange(len(rows)) - half, 0)
        end = np.minimum(np.arange(len(rows)) + half + 1, len(rows))
        summed = (
            np.cumsum(np.pad(each, ((1, 0), (0, 0))), axis=0) for each in (np.where(here, values[rows], 0.0), here)
        )
        total, count = (each[end] - each[first] for each in summed)
        found[rows] = np.where(here, total / np.maximum(count, 1), values[rows])
    return found
