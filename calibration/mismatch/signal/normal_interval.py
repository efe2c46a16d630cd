"""The 90 % interval of a normal density."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = TypeVar("Floats", float, NDArray[np.float64])

NINETY_PERCENT_STDS = 1.645
"""Half the width of a 90 % interval of a normal density, in standard deviations."""


def std_of_interval(low: Floats, high: Floats) -> Floats:
    """Return the standard deviation of the normal density that has this 90 % interval."""
    return (high - low) / (2 * NINETY_PERCENT_STDS)
