"""Least squares from products of columns with each other and with a residual."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROUNDING = 1e-12
"""Share of the residual's sum of squares below which what is left of it is rounding (a choice: double precision, with a
margin)."""
SINGULAR = 1e-12
"""Relative singular value of the products below which columns are the same (a choice: double precision, with a
margin)."""


def fitted(squares: Array, moments: Array) -> Array:
    """Return the coefficients, shape (column,), from products of columns with each other and with a residual."""
    size = np.sqrt(np.diag(squares))
    scale = np.where(size > 0, size, 1.0)
    return np.asarray(np.linalg.lstsq(squares / np.outer(scale, scale), moments / scale, rcond=SINGULAR)[0] / scale)


def squares_left(products: Array) -> tuple[float, float]:
    """Return the sum of squares that columns leave of a residual, and the last column's coefficient.

    `products` are those of the columns and, last, the residual with each other.
    """
    squares, moments = products[:-1, :-1], products[:-1, -1]
    found = fitted(squares, moments)
    left = products[-1, -1] - 2 * found @ moments + found @ squares @ found
    return max(float(left), ROUNDING * float(products[-1, -1])), float(found[-1]) if len(found) else 0.0
