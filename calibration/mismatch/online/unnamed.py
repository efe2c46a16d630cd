"""Whether one law explains what has begun: it is held against all columns together, on its wheels from its onset on.

All columns together, the laws' and the tangents' of the simulation, stand for a change that has no name. One law is a
special case of that, so that the difference of their Δχ² is χ² with as many degrees of freedom as the columns have
rank, less one, where the law is right (a test of lack of fit).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.online.scores import fitted_with
from regolithd.calibration.mismatch.signal.chi_squared import quantile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.online.scores import Place, Search
    from regolithd.calibration.mismatch.online.sums import Suffixes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Unnamed:
    """What all columns together explain on a set of wheels, from each segment's start on, shape (segment,) each.

    Attributes
    ----------
    statistic: Δχ²
    rank: of the columns
    score: Δχ² less what as many coefficients gain by chance
    information: of a root mean square: weighted readings
    """

    starts_s: Array
    statistic: Array
    rank: NDArray[np.int64]
    score: Array
    information: Array

    def onset_s(self) -> float:
        """Return from when on it explains most."""
        return float(self.starts_s[int(np.argmax(self.score))])


def unnamed(
    sums: Suffixes, weights: Array, search: Search, beside: Sequence[Place], wheels: int, level: float
) -> Unnamed:
    """Return what all columns together explain on a set of wheels, by its index, beside the places given.

    `level` is that of the test of one onset; other arguments as those of `scores`.
    """
    beside_it = fitted_with(sums, weights, search, beside)
    on = search.member[wheels] * weights
    gram = np.einsum("w,ewkl->ekl", on, sums.gram)
    products = np.einsum("w,ewkp->ekp", search.member[wheels], beside_it.products)
    left = gram - products @ beside_it.inverse @ np.swapaxes(products, 1, 2)
    target = np.einsum("w,ewk->ek", on, sums.moment) - products @ beside_it.fitted
    scale = np.sqrt(np.einsum("ekk->ek", gram))
    scale = np.where(scale > 0, scale, np.inf)
    size, axes = np.linalg.eigh(left / (scale[:, :, None] * scale[:, None, :]))
    known = size > search.least_tolerance
    along = np.einsum("ekj,ek->ej", axes, target / scale)
    statistic = np.sum(np.where(known, along**2 / np.where(known, size, 1.0), 0.0), axis=1)
    rank = known.sum(axis=1)
    by_chance = np.array([quantile(int(each), level) if each else 0.0 for each in rank])
    readings = np.einsum("w,ew->e", on, sums.acting.max(axis=2))
    return Unnamed(sums.starts_s, statistic, rank, statistic - by_chance, readings)


def lacks_fit(law: float, together: Unnamed, segment: int, level: float, inexact_share: float) -> bool:
    """Return whether all columns together explain more than a law's Δχ² by more than chance and its inexact shape."""
    rank = int(together.rank[segment])
    by_chance = quantile(rank - 1, level) if rank > 1 else 0.0
    return float(together.statistic[segment]) - law > by_chance + inexact_share * law
