"""Power spectrum of values summed over evenly spaced places, of angle or of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ZERO_PADDING = 4
"""Factor of zero padding: a line halfway between two resolved frequencies then loses a few percent of its power."""


def padded_length(last_place: int) -> int:
    """Return the length of the transform: `ZERO_PADDING` times the next power of two."""
    return ZERO_PADDING * int(2 ** np.ceil(np.log2(last_place + 2)))


def power_of_sums(place: NDArray[np.int64], values: Array, length: int) -> Array:
    """Return the power at each frequency of the values (n,), summed over each of their places (n,)."""
    return np.asarray(np.abs(np.fft.rfft(np.bincount(place, values, minlength=length))) ** 2, np.float64)
