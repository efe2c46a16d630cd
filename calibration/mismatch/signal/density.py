"""Quantiles of a density that is known on a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]


def quantiles(grid: Array, density: Array, shares: Sequence[float]) -> list[float]:
    """Return the places below which these shares of a density lie; it need not be normalised."""
    below = np.cumsum(density) - 0.5 * density
    return [float(np.interp(share * density.sum(), below, grid)) for share in shares]
