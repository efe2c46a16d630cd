"""The spectrum of what is summed over evenly spaced places, of angle or of time: where a residual has a line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FINER = 4
"""Points of the spectrum for each that the places resolve, so that a line between two is not overlooked."""


def padded_length(last_place: int) -> int:
    """Return how many places to transform: a power of two, which is quick, and `FINER`."""
    return FINER * int(2 ** np.ceil(np.log2(last_place + 2)))


def power_of_sums(place: NDArray[np.int64], values: Array, length: int) -> Array:
    """Return the power at each frequency of the values (n,), summed over each of their places (n,)."""
    return np.asarray(np.abs(np.fft.rfft(np.bincount(place, values, minlength=length))) ** 2, np.float64)
