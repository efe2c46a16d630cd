"""What a fit explains, instant by instant: the residual that it leaves, and what each of its terms adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search

Array = NDArray[np.float64]

NOW_AND_THEN = 0.4
"""What counts of an effect's size at the times when it acts, if at others it does not."""


def residual_of(search: Search, fit: Fit) -> Array:
    """Return measured less fitted, shape (time, wheel), 0 outside the mask."""
    dictionary = search.dictionary
    left = dictionary.residual.astype(np.float64)
    for (column, wheels), value in zip(fit.columns, fit.coefficients, strict=True):
        for w in wheels:
            left[w] -= value * dictionary.columns[column, w]
    restored = np.empty_like(left)
    restored[:, dictionary.order] = left
    return np.where(dictionary.problem.mask, restored.T, 0.0)


def contribution(search: Search, fit: Fit, index: int) -> Array:
    """Return what a term adds to the prediction, shape (time, wheel)."""
    dictionary, term = search.dictionary, fit.terms[index]
    total = np.zeros(dictionary.residual.shape)
    for column, value in zip(term.group.columns, fit.coefficients[fit.of_term(index)], strict=True):
        for w in term.wheels:
            total[w] += value * dictionary.columns[column, w]
    restored = np.empty_like(total)
    restored[:, dictionary.order] = total
    return restored.T


def size_of(search: Search, fit: Fit, index: int) -> float:
    """Return a term's size on its wheels, as a share of the channel's mean magnitude."""
    problem, on = search.dictionary.problem, list(fit.terms[index].wheels)
    return magnitude(contribution(search, fit, index)[:, on][problem.mask[:, on]] ** 2) / problem.mean_size


def magnitude(power: Array) -> float:
    """Return how large an effect with these squares is where it acts.

    Of a constant effect that is its root mean square; of one that acts now and then, two fifths of what it has then.
    """
    then = np.sum(power**2) / max(float(np.sum(power)), 1e-300)
    return float(np.sqrt(max(np.mean(power), NOW_AND_THEN**2 * then)))
