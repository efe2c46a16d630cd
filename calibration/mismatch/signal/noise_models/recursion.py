"""Linear recursions of the first order in time, as a filter's states follow: all instants at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-20
"""Factor of what was added so many instants before, below which it no longer counts: less than rounding."""


def recursion(factor: Array, added: Array) -> Array:
    """Return y(t) = factor(t) y(t − 1) + added(t), shape (time, column), from 0 before the first instant.

    Factors are at most 1 in magnitude, of shape (time, column) or (time, 1); one of 0 begins anew. By doubling: after k
    passes, each y has what was added in the last 2^k instants. `scipy.signal.lfilter` has no factors that change, and
    takes longer to import than this takes to compute.
    """
    factor, total, reach = factor.copy(), added.copy(), 1
    while reach < len(total) and np.any(np.abs(factor) > NEGLIGIBLE):
        total[reach:] += factor[reach:] * total[:-reach]
        factor[reach:] *= factor[:-reach].copy()
        factor[:reach] = 0.0
        reach *= 2
    return total
