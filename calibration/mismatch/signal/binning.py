"""Means of quantities in bins of a covariate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BinnedMeans:
    """Means in bins.

    Attributes
    ----------
    at: mean of the covariate, shape (bin,)
    count: values in a bin, at least 1, shape (bin,)
    means: of each quantity, shape (bin,) each
    """

    at: Array
    count: NDArray[np.int64]
    means: tuple[Array, ...]


def even_edges(values: Array, bins: int) -> Array:
    """Return bin edges that hold equal numbers of values; fewer where values coincide."""
    return np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)))


def binned_means(values: Array, edges: Array, *quantities: Array) -> BinnedMeans:
    """Return the means of quantities (n,) in bins of the values (n,); what is beyond the edges is in the outer bins.

    A bin without a value, between two that coincide with its edges, is left out.
    """
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(place)
    held = count > 0
    at, *means = (np.bincount(place, quantity)[held] / count[held] for quantity in (values, *quantities))
    return BinnedMeans(at, count[held], tuple(means))
