"""Groups of equally many columns: what each would gain beside a fit, computed for all of them at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.screening.schur import delta_chi2_of_each, delta_chi2_of_groups

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Left:
    """What a fit leaves on several sets of wheels.

    Attributes
    ----------
    on: 1 where a wheel is in a set, else 0, shape (set, wheel)
    moment: sums of products of other columns with what is left of the residual, shape (set, other)
    cross: sums of products of the fit's columns with others, shape (set, fitted, other)
    solved: the fit's covariance times `cross`, shape (set, fitted, other)
    energy: sums of squares of the other columns, shape (set, other)
    """

    on: Array
    moment: Array
    cross: Array
    solved: Array
    energy: Array


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

    def gains(self, left: Left, sets: Index, groups: Index, least_tolerance: float) -> Array:
        """Return the Δχ² of groups on sets of wheels, of which pairs are given, shape (pair,)."""
        if self.at.shape[1] == 1:
            at = self.at[:, 0]
            energy = left.energy[:, at]
            complement = energy - np.einsum("sfg,sfg->sg", left.cross[:, :, at], left.solved[:, :, at])
            gains = delta_chi2_of_each(left.moment[:, at], complement, energy, self.signs[:, 0], least_tolerance)
            return np.asarray(gains[sets, groups])
        at = self.at[groups]
        own = np.tensordot(left.on, self.own, axes=1)[sets, groups]
        # The indices of sets and columns are together, the fit's columns last: shape (pair, column, fitted).
        cross, solved = (each[sets[:, None], :, at] for each in (left.cross, left.solved))
        complement = own - cross @ np.swapaxes(solved, 1, 2)
        largest = np.max(np.diagonal(own, axis1=1, axis2=2), axis=1)
        moment = left.moment[sets[:, None], at]
        return delta_chi2_of_groups(moment, complement, largest, self.signs[groups], least_tolerance)
