"""Groups of equally many columns: what each would gain beside a fit, computed for all of them at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.schur import delta_chi2_of_each, delta_chi2_of_groups

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Left:
    """What a fit leaves on some wheels.

    Attributes
    ----------
    moment: sums of products of other columns with what is left of the residual, shape (other,)
    cross: sums of products of the fit's columns with others, shape (fitted, other)
    solved: the fit's covariance times `cross`, shape (fitted, other)
    """

    moment: Array
    cross: Array
    solved: Array


@dataclass(frozen=True, eq=False)
class Batch:
    """Groups of equally many columns.

    Attributes
    ----------
    which: their places among the groups that were asked for, shape (group,)
    at: the places of their columns among those that were asked for, shape (group, column)
    signs: of their coefficients, 0 for either, shape (group, column)
    own: weighted sums of products of their columns with each other, shape (wheel, group, column, column); none where
        they have one column
    """

    which: Index
    at: Index
    signs: Array
    own: Array

    def of(self, wanted: NDArray[np.bool_]) -> Batch:
        """Return those groups that are wanted, of which each has a place in `wanted`."""
        kept = wanted[self.which]
        own = self.own[:, kept] if self.own.shape[1] else self.own
        return Batch(self.which[kept], self.at[kept], self.signs[kept], own)

    def gains(self, left: Left, energy: Array, wheels: Sequence[int], least_tolerance: float) -> Array:
        """Return the Δχ² of each group on some wheels, shape (group,); `energy` is each column's there."""
        if self.at.shape[1] == 1:
            at = self.at[:, 0]
            complement = energy[at] - np.einsum("fc,fc->c", left.cross[:, at], left.solved[:, at])
            return delta_chi2_of_each(left.moment[at], complement, energy[at], self.signs[:, 0], least_tolerance)
        own = self.own[wheels].sum(axis=0)
        explained = np.moveaxis(left.cross[:, self.at], 0, 2) @ np.moveaxis(left.solved[:, self.at], 0, 1)
        largest = np.max(np.diagonal(own, axis1=1, axis2=2), axis=1)
        return delta_chi2_of_groups(left.moment[self.at], own - explained, largest, self.signs, least_tolerance)
