"""A curve over a covariate that stands for physics without a name: points, band and range, as data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_TOLD = 0.0005
"""Relative change of an error below which it is told as none: percent have one decimal."""
LEAST_VARIED = 0.1
"""Deviation of a curve's values as a share of their mean, below which it is a constant (a choice: a law that is a
little wrong deviates by as much)."""


@dataclass(frozen=True)
class EmpiricalCurve:
    """A piecewise linear function of a covariate, fitted to one recording; outside its range it keeps its end values.

    What it adds to the prediction is its value times a factor. The factor is what `coupling` says: "offset" 1, "drag"
    the direction of motion, "gain" the prediction, "drag, opposite sides" the direction times −1 on the left and +1 on
    the right (the simulation's `contrasts`), "each way" 1 with a covariate that has its sign.

    Attributes
    ----------
    coupling: how it acts
    magnitude: whether it is a function of the covariate's magnitude
    unit: of its values: the channel's, or "1" where it acts as a gain
    covariate_unit: the covariate's; empty where nothing says it
    at: the knots, ascending; the first and the last are the ends of its range
    value, low, high: at the knots, with the ends of a 90 % band
    held_out_rmse_before, held_out_rmse_after: root-mean-square error of the channel without and with the curve, on
        blocks of time that fitted neither of them
    """

    coupling: str
    magnitude: bool
    unit: str
    covariate_unit: str
    at: tuple[float, ...]
    value: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    held_out_rmse_before: float
    held_out_rmse_after: float

    @property
    def hardly_varies(self) -> bool:
        """Whether its values deviate from their mean by less than `LEAST_VARIED` of it (root mean square).

        Values count by how well they are known.
        """
        width = np.maximum(np.subtract(self.high, self.low), 1e-300)
        known, values = 1 / width**2, np.array(self.value)
        mean = float(np.average(values, weights=known))
        return bool(np.average((values - mean) ** 2, weights=known) < (LEAST_VARIED * mean) ** 2)

    @property
    def helps_held_out(self) -> bool:
        """Whether the held-out error is lower with it, by at least `LEAST_TOLD`."""
        return self.held_out_rmse_after < (1 - LEAST_TOLD) * self.held_out_rmse_before


@dataclass(frozen=True)
class StatedCurve:
    """An empirical curve that a corrected simulation has, and where: channel, wheels (their names) and covariate."""

    channel: str
    wheels: tuple[int | str, ...]
    covariate: str
    curve: EmpiricalCurve
