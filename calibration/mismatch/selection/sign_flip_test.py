"""Sign-flip test: the score that a search finds where nothing is missing.

The residual's blocks get new signs and are searched in the same way. A block of one wheel keeps its own autocorrelation
and size; its sign carries no information where nothing is missing. The largest score over all candidates, shapes and
wheels then has one distribution for the whole search (a randomisation test, Winkler et al., 2014).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Fit, Term
from regolithd.calibration.mismatch.regression.normal_equations import membership
from regolithd.calibration.mismatch.regression.penalties import full_penalty
from regolithd.calibration.mismatch.regression.screening.schur import delta_chi2_of_each, schur_diagonal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Group
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def entry_threshold(equations: NormalEquations, residual: Array, blocks: Index) -> float:
    """Return the score above which a term may be named: a quantile of the largest score by chance, within limits."""
    limits = equations.thresholds
    by_chance = largest_by_chance(equations, residual, blocks)
    quantile = np.quantile(by_chance, 1 - limits.false_name_rate) + limits.sign_flip_margin
    return float(np.clip(quantile, limits.least_entry, limits.largest_entry))


@dataclass(frozen=True, eq=False)
class _Draws:
    """Moments of the columns in each draw, and the free parameters' coefficients there.

    Attributes
    ----------
    columns: indices in the design matrix, in the order of the moments
    moments: shape (draw, wheel, column)
    fit: of the free parameters
    coefficients: of the free parameters in each draw, shape (draw, parameter)
    """

    columns: Index
    moments: Array
    fit: Fit
    coefficients: Array


def largest_by_chance(equations: NormalEquations, residual: Array, blocks: Index) -> Array:
    """Return the largest score of single-column candidates in each draw, shape (draw,).

    `residual` [time, wheel] has as little structure as possible: what is left of it counts as chance.
    """
    draws = equations.thresholds.sign_flip_draws
    groups = [group for group in equations.design.groups if group.named and len(group.columns) == 1]
    if not groups:
        return np.zeros(draws)
    drawn = _draw(equations, groups, residual, blocks)
    largest = np.full(draws, -np.inf)
    for wheels, kind in equations.wheel_sets.items():
        shared = [group for group in groups if group.may_be_shared(kind) or len(equations.weights) == 1]
        if shared:
            scores = _scores(equations, shared, wheels, drawn)
            largest = np.maximum(largest, scores.max(axis=1))
    return largest


def _draw(equations: NormalEquations, groups: Sequence[Group], residual: Array, blocks: Index) -> _Draws:
    fit = equations.fit(())
    columns = np.array(sorted({c for c, _ in fit.columns} | {group.columns[0] for group in groups}), np.int64)
    scores = block_scores(equations, columns, residual, blocks)
    moments = sign_flipped(scores, equations.thresholds.sign_flip_draws)
    at = np.searchsorted(columns, [c for c, _ in fit.columns])
    share = membership(fit.columns, len(equations.weights))
    coefficients = np.einsum("dwc,cw->dc", moments[:, :, at], share) @ fit.covariance
    return _Draws(columns, moments, fit, coefficients)


def block_scores(equations: NormalEquations, columns: Index, residual: Array, blocks: Index) -> Array:
    """Return the sum of column × residual × weight over each block, shape (block, wheel, column)."""
    design = equations.design
    in_order = blocks[design.order]
    by_block = np.argsort(in_order, kind="stable")
    starts = np.flatnonzero(np.diff(in_order[by_block], prepend=-1))
    white = design.whitened(design.in_folds(residual)) * equations.weights[:, None]
    weighted = white[:, by_block].astype(np.float32)
    scores = np.empty((len(starts), len(weighted), len(columns)))
    for place, column in enumerate(columns):
        products = design.columns([column])[0][:, by_block] * weighted
        scores[:, :, place] = np.add.reduceat(products, starts, axis=1).T
    return scores


def sign_flipped(scores: Array, draws: int) -> Array:
    """Return moments with the signs of the blocks drawn anew, shape (draw, wheel, column)."""
    generator = np.random.default_rng(0)
    signs = generator.choice([-1.0, 1.0], (draws, *scores.shape[:2]))
    of_wheels = signs.transpose(2, 0, 1) @ scores.transpose(1, 0, 2)
    return of_wheels.transpose(1, 0, 2)


def _scores(equations: NormalEquations, groups: Sequence[Group], wheels: tuple[int, ...], drawn: _Draws) -> Array:
    """Return Δχ² less penalty of each group in each draw, shape (draw, group)."""
    chosen = list(wheels)
    at = np.array([group.columns[0] for group in groups], np.int64)
    cross = equations.cross(drawn.fit.columns, at, wheels)
    energy = equations.energies(at)[chosen].sum(axis=0)
    moment = drawn.moments[:, chosen][:, :, np.searchsorted(drawn.columns, at)].sum(axis=1)
    gain = delta_chi2_of_each(
        moment - drawn.coefficients @ cross,
        schur_diagonal(energy, cross, drawn.fit.covariance),
        energy,
        np.array([group.signs[0] for group in groups]),
        equations.thresholds.least_tolerance,
    )
    # Draws do not touch another channel: what it credits to a fault is left out.
    terms = [Term(group, wheels) for group in groups]
    return gain - np.array([full_penalty(term, len(equations.weights), equations.thresholds) for term in terms])
