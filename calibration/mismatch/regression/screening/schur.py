"""Schur complements: what columns still explain beside others that are fitted already.

With normal equations in blocks, [[A, B], [Bᵀ, C]], the columns of the second block have the energy C − Bᵀ A⁻¹ B outside
the span of the first. Their Δχ² beside the first is rᵀ (C − Bᵀ A⁻¹ B)⁻¹ r, with r their moment on the first's residual
(Frisch, Waugh and Lovell).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]


def pseudo_inverse(matrix: Array, singular: float) -> Array:
    """Return the pseudo-inverse of normal equations: undetermined directions have no part in the solution.

    The matrix is scaled to a diagonal of 1 first, since precisions of priors differ by the squares of their units;
    `singular` is the relative eigenvalue below which a direction then counts as undetermined; one below 0 is rounding.
    """
    size = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    determined = values > singular * values.max(initial=0.0)
    kept = vectors[:, determined] / size[:, None]
    return np.asarray(kept / values[determined] @ kept.T, np.float64)


def explained_part(cross: Array, inverse: Array) -> Array:
    """Return Bᵀ A⁻¹ B, shape (new, new), from B of shape (fitted, new) and A⁻¹."""
    return cross.T @ inverse @ cross


def schur_complement(own: Array, cross: Array, inverse: Array) -> Array:
    """Return C − Bᵀ A⁻¹ B, shape (new, new)."""
    return own - explained_part(cross, inverse)


def held_by_last(matrix: Array, first: int, last: int, size: Array, singular: float) -> float:
    """Return the Δχ² that the last columns have in common with columns before them of some size, beside the first ones.

    Parameters
    ----------
    matrix: of the normal equations, shape (column, column)
    first, last: how many columns are first, and where the last ones begin
    size: coefficients of the columns in between, shape (last - first,)
    """
    inverse = pseudo_inverse(matrix[:first, :first], singular) if first else np.zeros((0, 0))
    beside = schur_complement(matrix[first:, first:], matrix[:first, first:], inverse)
    common = beside[last - first :, : last - first] @ size
    return float(common @ pseudo_inverse(beside[last - first :, last - first :], singular) @ common)


def schur_diagonal(own_diagonal: Array, cross: Array, inverse: Array) -> Array:
    """Return the diagonal of the Schur complement alone, shape (…, new): for many columns, each by itself."""
    return np.asarray(own_diagonal - np.einsum("...sp,...sp->...p", cross, inverse @ cross))


def delta_chi2_of_each(
    moment: Array, complement: Array, own_diagonal: Array, signs: Array, least_tolerance: float
) -> Array:
    """Return the Δχ² of columns each by itself, shape (…, new).

    It is 0 for a column that is a combination of the fitted ones, or whose coefficient has the wrong sign.
    """
    new = complement > least_tolerance * own_diagonal
    allowed = new & (moment * signs >= 0)
    return np.where(allowed, moment**2 / np.where(new, complement, 1.0), 0.0)


def delta_chi2_together(
    moment: Array, complement: Array, largest_energy: float, signs: Sequence[int], least_tolerance: float
) -> float:
    """Return the Δχ² of columns together; 0 where a coefficient has the wrong sign.

    Directions with less than `least_tolerance` of the largest column's energy are left out.
    """
    energy, of_signs = np.array([largest_energy]), np.array([signs], np.float64)
    return float(delta_chi2_of_groups(moment[None], complement[None], energy, of_signs, least_tolerance)[0])


def delta_chi2_of_groups(
    moment: Array, complement: Array, largest_energy: Array, signs: Array, least_tolerance: float
) -> Array:
    """Return the same of groups of equally many columns, shape (group,).

    Moments and signs have the shape (group, column), complements (group, column, column), energies (group,).
    """
    values, vectors = np.linalg.eigh(complement)
    kept = values > least_tolerance * largest_energy[:, None]
    along = np.einsum("gji,gj->gi", vectors, moment)
    scaled = np.where(kept, along / np.where(kept, values, 1.0), 0.0)
    coefficients = np.einsum("gij,gj->gi", vectors, scaled)
    return np.where(np.any(signs * coefficients < 0, axis=1), 0.0, np.einsum("gi,gi->g", along, scaled))


def with_further_readings(gram: Array, moment: Array, reductions: Array, singular: float) -> tuple[Array, Array]:
    """Return sums of products, and moments, with what columns know at frequencies of little noise.

    What is beyond the long-run variance's weight is that of further readings, of which these columns' span alone is
    known: all columns, and the residual, count there by their projection on it. So what other columns explain is no
    more evidence for these than in a fit by one weight.

    Parameters
    ----------
    gram, moment: weighted by the long-run variance, shape (column, column), (column,)
    reductions: long-run variance of the noise over that at the frequencies of each column, shape (column,)
    singular: relative eigenvalue below which a direction of the columns' span counts as undetermined
    """
    span = np.flatnonzero((reductions > 1) & (np.diag(gram) > 0))
    if not span.size:
        return gram, moment
    further = np.sqrt(reductions[span] - 1)
    inverse = pseudo_inverse(gram[np.ix_(span, span)], singular)
    along = further[:, None] * gram[span]
    return gram + along.T @ inverse @ along, moment + along.T @ inverse @ (further * moment[span])
