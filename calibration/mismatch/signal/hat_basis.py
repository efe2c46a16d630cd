"""Hat functions: the basis of piecewise linear functions of a covariate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OUTER_QUANTILES = (0.005, 0.995)
"""Quantiles of the covariate at the outermost knots: single extreme readings do not move them."""
FEWEST_KNOTS = 3


@dataclass(frozen=True, eq=False)
class KnotPlaces:
    """Between which knots the values of a covariate are.

    Attributes
    ----------
    knots: number of knots
    left: the knot to the left of each value, of the covariate's shape
    right_share: what the hat function of the next one is there; that of the left one is 1 less this
    """

    knots: int
    left: NDArray[np.int64]
    right_share: Array

    @classmethod
    def of(cls, values: Array, known: NDArray[np.bool_], knots: int) -> KnotPlaces | None:
        """Return it for a covariate, None where the `known` values have fewer than three knots.

        Knots are halfway between quantiles and an even spacing.
        """
        if not known.any():
            return None
        at = _knots(values[known], knots)
        return cls.between(values, known, at) if len(at) >= FEWEST_KNOTS and at[-1] > at[0] else None

    @classmethod
    def between(cls, values: Array, known: NDArray[np.bool_], at: Array) -> KnotPlaces:
        """Return it for knots at these places, ascending; values beyond them count as those at the outermost ones."""
        clipped = np.clip(np.where(known, values, at[0]), at[0], at[-1])
        left = np.clip(np.searchsorted(at, clipped, side="right") - 1, 0, len(at) - 2)
        right_share = np.where(clipped < at[-1], (1 / np.diff(at))[left] * (clipped - at[left]), 1.0)
        return cls(len(at), left, right_share)


def hat_functions(values: Array, mask: NDArray[np.bool_], knots: int) -> list[Array]:
    """Return hat functions of a covariate, each of the covariate's shape; they sum to 1 where it is known.

    Empty where the covariate has fewer than three knots.
    """
    known = mask & np.isfinite(values)
    between = KnotPlaces.of(values, known, knots)
    return [] if between is None else _hats(between, known)


def hat_functions_at(values: Array, mask: NDArray[np.bool_], at: Array) -> list[Array]:
    """Return hat functions of a covariate with knots at these places, ascending."""
    known = mask & np.isfinite(values)
    return _hats(KnotPlaces.between(values, known, at), known)


def _hats(between: KnotPlaces, known: NDArray[np.bool_]) -> list[Array]:
    hats = np.zeros((between.knots, *known.shape))
    np.put_along_axis(hats, between.left[None], np.where(known, 1 - between.right_share, 0.0)[None], axis=0)
    np.put_along_axis(hats, between.left[None] + 1, np.where(known, between.right_share, 0.0)[None], axis=0)
    return list(hats)


def range_of(values: Array) -> tuple[float, float]:
    """Return where the outermost knots of known values are."""
    low, high = np.quantile(values, OUTER_QUANTILES)
    return float(low), float(high)


def _knots(inside: Array, count: int) -> Array:
    low, high = range_of(inside)
    quantiles = np.quantile(inside, np.linspace(*OUTER_QUANTILES, count))
    return np.unique(0.5 * (quantiles + np.linspace(low, high, count)))
