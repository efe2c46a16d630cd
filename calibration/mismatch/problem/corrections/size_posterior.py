"""The density of an effect's size together with the simulation's parameters, for the next recording to begin from.

A recording often knows a combination of an effect and a parameter better than either: drag and a coefficient of the
load add up. Standard deviations of each alone forget that; a later recording then finds both within their own, where
the two together cannot be what they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SizePosterior:
    """Normal density of parameters and of an effect's relative size, from the recording in which it was found.

    Attributes
    ----------
    parameters: names
    values: means of the parameters, in their own units; that of the relative change of the size is 0
    covariance: of the parameters, in this order, and of the relative size, which is last: a row each
    """

    parameters: tuple[str, ...]
    values: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, values: dict[str, float], covariance: Array) -> SizePosterior:
        """Return the density with these means of parameters; the size is the last row of the covariance."""
        return cls(tuple(values), tuple(values.values()), tuple(map(tuple, covariance.tolist())))

    @property
    def matrix(self) -> Array:
        """The covariance, shape (parameter + 1, parameter + 1)."""
        return np.array(self.covariance, np.float64)
