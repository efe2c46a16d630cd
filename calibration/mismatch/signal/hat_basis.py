"""Hat functions: the basis of piecewise linear functions of a covariate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OUTER_QUANTILES = (0.005, 0.995)
"""Quantiles of the covariate at the outermost knots: single extreme readings do not move them."""
FEWEST_KNOTS = 3


def hat_functions(values: Array, mask: NDArray[np.bool_], knots: int) -> list[Array]:
    """Return hat functions of a covariate, each of the covariate's shape; they sum to 1 where it is known.

    Knots are halfway between quantiles and an even spacing. Empty where the covariate has fewer than three knots.
    """
    known = mask & np.isfinite(values)
    if not known.any():
        return []
    at = _knots(values[known], knots)
    if len(at) < FEWEST_KNOTS or at[-1] - at[0] <= 0:
        return []
    clipped = np.clip(np.where(known, values, at[0]), at[0], at[-1])
    left = np.clip(np.searchsorted(at, clipped, side="right") - 1, 0, len(at) - 2)
    right_share = np.where(clipped < at[-1], (1 / np.diff(at))[left] * (clipped - at[left]), 1.0)
    hats = np.zeros((len(at), *values.shape))
    np.put_along_axis(hats, left[None], np.where(known, 1 - right_share, 0.0)[None], axis=0)
    np.put_along_axis(hats, left[None] + 1, np.where(known, right_share, 0.0)[None], axis=0)
    return list(hats)


def _knots(inside: Array, count: int) -> Array:
    low, high = (float(q) for q in np.quantile(inside, OUTER_QUANTILES))
    quantiles = np.quantile(inside, np.linspace(*OUTER_QUANTILES, count))
    return np.unique(0.5 * (quantiles + np.linspace(low, high, count)))
