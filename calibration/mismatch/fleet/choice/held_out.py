"""Errors on recordings that did not fit the effects; all recordings chose them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.fleet.choice.selection import folds_of, without

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HeldOutSquares:
    """Sums of squares on recordings that did not fit the effects, each of shape (recording, wheel).

    Attributes
    ----------
    before, after: without any effect, and with all as the other recordings fit them
    without: with all but one, for each effect
    """

    before: Array
    after: Array
    without: tuple[Array, ...]


def held_out_squares(equations: FleetEquations, fit: FleetFit) -> HeldOutSquares:
    """Fit on all folds but one, measure on that one, for each fold in turn."""
    shape = equations.counts.shape
    before, after, but_one = np.zeros(shape), np.zeros(shape), [np.zeros(shape) for _ in fit.terms]
    for fold in folds_of(equations):
        used, out = 1.0 - fold if fold.min() == 0 else fold, fold > 0
        before[out] = equations.squares(equations.fit((), used))[out]
        after[out] = equations.squares(equations.fit(fit.terms, used))[out]
        for index, squares in enumerate(but_one):
            squares[out] = equations.squares(equations.fit(without(fit, index), used))[out]
    return HeldOutSquares(before, after, tuple(but_one))
