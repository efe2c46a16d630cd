"""Quantiles of χ², for whole degrees of freedom.

SciPy has them too, but takes as long to load as a thirtieth of a comparison.
"""

from __future__ import annotations

from functools import lru_cache
from math import erfc, exp, gamma, sqrt


def survival(degrees: int, value: float) -> float:
    """Return the probability that χ² with so many degrees of freedom is above a value.

    It is Q(a, x) with a half of the degrees and x half of the value, from Q(1/2, x) = erfc(√x) or Q(0, x) = 0 upwards:
    Q(a + 1, x) = Q(a, x) + x^a e^(−x) / Γ(a + 1) (Abramowitz and Stegun, 6.5.21).
    """
    half, reached = value / 2, degrees % 2 / 2
    total = erfc(sqrt(half)) if reached else 0.0
    further = half**reached * exp(-half) / gamma(reached + 1)
    while reached < degrees / 2:
        total += further
        reached += 1
        further *= half / reached
    return total


@lru_cache
def quantile(degrees: int, level: float) -> float:
    """Return the value above which χ² is with a probability of `level`, by bisection to the last digit."""
    low, high = 0.0, 1.0
    while survival(degrees, high) > level:
        low, high = high, 2 * high
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if survival(degrees, middle) > level else (low, middle)
    return high
