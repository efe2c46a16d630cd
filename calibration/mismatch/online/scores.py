"""The generalised likelihood ratio of every law, on every set of wheels, from every onset on.

The simulation's parameters and the changes that were reported are fitted together with each. With A the information of
a column from its onset on, X its products with what is fitted beside it, N the information of that and β its estimate,

    u = a − X β,   J = A − Xᵀ N⁻¹ X,   θ = u / J,   Δχ² = u² / J,

each weighted by one over the long-run variance of the noise, as in the comparison of a whole recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.online.sums import Suffixes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """A law on a set of wheels from a time on: indices of law and set, and the onset [s]."""

    law: int
    wheels: int
    onset_s: float


@dataclass(frozen=True, eq=False)
class Search:
    """What may be where: fixed when the beginning of the recording has been learned.

    Attributes
    ----------
    precision: one over the prior variance of each tangent's coefficient, shape (tangent,)
    member: whether a wheel is in a set, shape (set, wheel)
    at_start, later: whether a law may act from the start, and begin later, on a set, shape (set, law) each
    signs: of the laws' coefficients, 0 for either, shape (law,)
    least_tolerance: share of a column's information that has to be left beside the others
    smallest_effect: least root mean square of a change, over the channel's mean magnitude
    """

    precision: Array
    member: Array
    at_start: NDArray[np.bool_]
    later: NDArray[np.bool_]
    signs: Array
    least_tolerance: float
    smallest_effect: float


@dataclass(frozen=True, eq=False)
class Scores:
    """Δχ² and size of each law on each set from each segment's start on, shape (segment, set, law).

    Attributes
    ----------
    statistic: Δχ²; 0 where a law may not be, has the wrong sign or is too small
    size, std: of the coefficient
    """

    starts_s: Array
    statistic: Array
    size: Array
    std: Array

    def best(self) -> Place:
        """Return where the statistic is largest."""
        segment, wheels, law = np.unravel_index(int(np.argmax(self.statistic)), self.statistic.shape)
        return Place(int(law), int(wheels), float(self.starts_s[segment]))

    def best_of(self, place: Place) -> Place:
        """Return the best onset of a place's law on its wheels."""
        segment = int(np.argmax(self.statistic[:, place.wheels, place.law]))
        return replace(place, onset_s=float(self.starts_s[segment]))

    def near(self, place: Place, member: Array, within_s: float) -> Array:
        """Return the largest Δχ² about a place's onset on sets that share a wheel with it, shape (set, law).

        `member` is whether a wheel is in a set, shape (set, wheel).
        """
        about = np.abs(self.starts_s - place.onset_s) <= within_s
        sharing = (member @ member[place.wheels]) > 0
        return np.where(sharing[:, None], self.statistic[about].max(axis=0), 0.0)

    def at(self, place: Place) -> tuple[int, int, int]:
        """Return the indices of a place."""
        return int(np.flatnonzero(self.starts_s == place.onset_s)[0]), place.wheels, place.law


def scores(sums: Suffixes, weights: Array, search: Search, beside: Sequence[Place]) -> Scores:
    """Return the scores of every law beside the tangents and the places given; `weights` has shape (wheel,)."""
    count = len(search.precision)
    gram, moment = sums.gram * weights[:, None, None], sums.moment * weights[:, None]
    others = fitted_with(sums, weights, search, beside)
    inverse, fitted = others.inverse, others.fitted
    own = np.einsum("sw,ewkk->esk", search.member, gram[:, :, count:, count:])
    together = np.einsum("sw,ewkp->eskp", search.member, others.products[:, :, count:])
    left = own - np.einsum("eskp,eskp->esk", together @ inverse, together)
    known = left > search.least_tolerance * own
    left = np.where(known, left, np.inf)
    rough = np.einsum("sw,ewk->esk", search.member, moment[:, :, count:])
    size = (rough - together @ fitted) / left
    statistic = size**2 * np.where(known, left, 0.0)
    counted = _may_be(search, len(gram)) & (size * search.signs >= 0) & _visible(sums, search, size)
    return Scores(sums.starts_s, np.where(counted, statistic, 0.0), size, 1 / np.sqrt(left))


@dataclass(frozen=True, eq=False)
class Beside:
    """What is fitted beside a column: tangents, then places.

    Attributes
    ----------
    inverse: of the information with the priors, shape (coefficient, coefficient)
    fitted: the coefficients without that column, shape (coefficient,)
    products: with all columns, from each segment's start on, shape (segment, wheel, column, coefficient)
    """

    inverse: Array
    fitted: Array
    products: Array


def fitted_with(sums: Suffixes, weights: Array, search: Search, places: Sequence[Place]) -> Beside:
    """Fit the tangents and the places given to all that is there."""
    gram, moment = sums.gram * weights[:, None, None], sums.moment * weights[:, None]
    count = len(search.precision)
    columns = [count + place.law for place in places]
    at = [int(np.flatnonzero(sums.starts_s == place.onset_s)[0]) for place in places]
    on = [search.member[place.wheels] for place in places]
    information = np.zeros((count + len(places),) * 2)
    information[:count, :count] = gram[0].sum(axis=0)[:count, :count] + np.diag(search.precision)
    for i, column in enumerate(columns):
        information[count + i, :count] = information[:count, count + i] = on[i] @ gram[at[i]][:, column, :count]
        for j, other in enumerate(columns):
            both = gram[max(at[i], at[j])]  # two laws are there together from the later onset on
            information[count + i, count + j] = (on[i] * on[j]) @ both[:, column, other]
    with_places = [on[i] @ moment[at[i]][:, column] for i, column in enumerate(columns)]
    later = [np.maximum(np.arange(len(gram)), first) for first in at]
    products = [gram[later[i]][:, :, :, column] * on[i][:, None] for i, column in enumerate(columns)]
    inverse = _inverse(information)
    return Beside(
        inverse,
        inverse @ np.array([*moment[0].sum(axis=0)[:count], *with_places]),
        np.concatenate((gram[:, :, :, :count], *(each[..., None] for each in products)), axis=-1),
    )


def _may_be(search: Search, segments: int) -> NDArray[np.bool_]:
    """Return which law may be on which set from each segment on, shape (segment, set, law)."""
    later = np.broadcast_to(search.later, (segments - 1, *search.later.shape))
    return np.concatenate((search.at_start[None], later))


def _visible(sums: Suffixes, search: Search, size: Array) -> NDArray[np.bool_]:
    """Return where a law is large enough, while it acts, to be worth a report."""
    laws = slice(len(search.precision), None)
    acting = np.einsum("sw,ewk->esk", search.member, sums.acting[:, :, laws])
    power = np.einsum("sw,ewkk->esk", search.member, sums.gram[:, :, laws, laws]) / np.maximum(acting, 1.0)
    return np.asarray(size**2 * power > (search.smallest_effect * sums.mean_size) ** 2)


def _inverse(information: Array) -> Array:
    """Return the inverse of a positive semidefinite matrix, with its diagonal scaled to 1 first."""
    scale = np.sqrt(np.where(np.diag(information) > 0, np.diag(information), 1.0))
    both = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(information / both, 1e-10, hermitian=True)) / both
