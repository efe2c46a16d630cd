"""What the search finds where nothing is: the residual with its blocks' signs drawn anew, searched in the same way.

A block of one wheel keeps its own autocorrelation and size, and its sign says nothing when nothing is missing. The
largest score over all candidates, shapes and wheels then has one distribution for the whole search.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.selection.subset_selection import Search, Term, shared

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import Group

Array = NDArray[np.float64]

DRAWS = 600
FALSE_NAMES = 0.005
"""How often a search may name something where nothing is."""
LEAST, MOST = 5.0, 12.0
"""Six hundred draws do not know their own tail: what they say of it is held within these."""


def naming_threshold(search: Search, residual: Array, blocks: NDArray[np.int64]) -> float:
    """Return the score above which a term earns its name."""
    chance = largest_by_chance(search, (), residual, blocks)
    return float(np.clip(np.quantile(chance, 1 - FALSE_NAMES) + 1.0, LEAST, MOST))


def largest_by_chance(search: Search, given: Sequence[Term], residual: Array, blocks: NDArray[np.int64]) -> Array:
    """Return the largest score of single-column candidates in each draw, shape (draw,).

    `residual` [time, wheel] has no structure left, or as little as possible: what stays in it looks like chance.
    """
    groups = [g for g in search.dictionary.groups if g.named and len(g.columns) == 1]
    if not groups:
        return np.zeros(DRAWS)
    fitted = search.fit(given)
    columns = sorted({c for c, _ in fitted.columns} | {g.columns[0] for g in groups})
    place = {column: k for k, column in enumerate(columns)}
    moments = _flipped(_block_scores(search, columns, residual, blocks))
    largest = np.full(DRAWS, -np.inf)
    share = np.zeros((len(fitted.columns), len(search.weights)))
    for row, (_, wheels) in enumerate(fitted.columns):
        share[row, list(wheels)] = 1
    at = [place[c] for c, _ in fitted.columns]
    nuisance = np.einsum("dwc,cw->dc", moments[:, :, at], share) @ fitted.covariance
    for pattern, kind in search.patterns.items():
        fitting = [g for g in groups if shared(g, kind) or len(search.weights) == 1]
        if fitting:
            scores = _scores(
                search, fitting, pattern, moments, place, nuisance, fitted.columns, share, fitted.covariance
            )
            largest = np.maximum(largest, scores.max(axis=1))
    return largest


def _block_scores(search: Search, columns: list[int], residual: Array, blocks: NDArray[np.int64]) -> Array:
    """Return Σ column × residual × weight over each block, shape (block, wheel, column)."""
    dictionary = search.dictionary
    in_order = blocks[dictionary.order]
    by_block = np.argsort(in_order, kind="stable")
    starts = np.flatnonzero(np.diff(in_order[by_block], prepend=-1))
    weighted = (residual * search.weights)[dictionary.order].T[:, by_block].astype(np.float32)
    sums = [np.add.reduceat(dictionary.columns[c][:, by_block] * weighted, starts, axis=1).T for c in columns]
    return np.stack(sums, axis=2).astype(np.float64)


def _flipped(scores: Array) -> Array:
    """Return moments with the blocks' signs drawn anew, shape (draw, wheel, column)."""
    generator = np.random.default_rng(0)
    signs = generator.choice([-1.0, 1.0], (DRAWS, *scores.shape[:2]))
    return np.einsum("dbw,bwc->dwc", signs, scores, optimize=True)


def _scores(
    search: Search,
    groups: Sequence[Group],
    pattern: tuple[int, ...],
    moments: Array,
    place: dict[int, int],
    nuisance: Array,
    fitted: Sequence[tuple[int, tuple[int, ...]]],
    share: Array,
    inverse: Array,
) -> Array:
    """Return gain less price of each group in each draw, shape (draw, group)."""
    at = [g.columns[0] for g in groups]
    rows = [c for c, _ in fitted]
    chosen = list(pattern)
    reach = np.zeros((len(rows), len(at)))
    for w in chosen:
        reach += share[:, w, None] * search.gram[w][np.ix_(rows, at)]
    own = search.gram[chosen][:, at, at].sum(axis=0)
    single = own - np.einsum("sp,st,tp->p", reach, inverse, reach)
    left = moments[:, chosen][:, :, [place[c] for c in at]].sum(axis=1) - nuisance @ reach
    signs = np.array([g.signs[0] for g in groups])
    new = single > 1e-3 * own
    gain = np.where(new & (left * signs >= 0), left**2 / np.where(new, single, 1.0), 0.0)
    # Another channel's word is no help here: draws do not touch it.
    terms = [Term(g, pattern) for g in groups]
    prices = np.array([term.price(len(search.weights)) + term.bonus for term in terms])
    return gain - prices
