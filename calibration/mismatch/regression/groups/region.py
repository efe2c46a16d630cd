"""A region: where a covariate lies between two bounds, and the form of what the simulation leaves out there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

HIGHEST_POWER = 3
"""Of the polynomials in a region (a choice: a law has one bend or two)."""
FORMS = ((0,), (1,), (0, 1), (0, 1, 2, 3))
"""Powers of the distance from the bound: a step, growth from nothing, a line, a cubic polynomial."""
GROWTH = (1,)
"""The form that begins with nothing at the bound: there has to be one bound alone."""


@dataclass(frozen=True)
class Region:
    """A range of a covariate, and a polynomial in it.

    Attributes
    ----------
    covariate, coupling: what is bounded, and how the polynomial acts, as in the groups of smooth terms
    lower, upper: the bounds; infinite where there is none. The lower one is in the region, the upper one is not.
    powers: of (value − origin) / width
    origin, width: the bound, where there is one alone, else the middle; and a scale
    """

    covariate: str
    coupling: str
    lower: float
    upper: float
    powers: tuple[int, ...]
    origin: float
    width: float

    def contains(self, values: Array) -> Mask:
        """Return where the covariate is in the region; not where it is unknown."""
        return np.asarray((values >= self.lower) & (values < self.upper))

    def columns(self, values: Array, factor: Array) -> list[Array]:
        """Return the polynomial's columns where the covariate has these values, shape (time, wheel) each."""
        inside = self.contains(values)
        distance = np.where(inside, (values - self.origin) / self.width, 0.0)
        return [np.where(inside, factor * distance**power, 0.0) for power in self.powers]
