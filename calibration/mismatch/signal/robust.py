"""Scatter that single readings far away do not move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAD_TO_STD = 1.4826
"""Standard deviation of a normal density over its median absolute deviation."""


def robust_std(values: Array) -> float:
    """Return the standard deviation of normal values (n,) by their median absolute deviation; 0 of none."""
    return MAD_TO_STD * float(np.median(np.abs(values - np.median(values)))) if values.size else 0.0
