"""Errors on blocks of time that neither chose the effects nor fitted them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.selection.best_subsets import acceptable, best_per_family, enough
from regolithd.calibration.mismatch.selection.cross_validation import squares
from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search, Term

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import Group
    from regolithd.calibration.mismatch.signal.noise import Noise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOut:
    """Root mean squares over all held-out blocks.

    Attributes
    ----------
    before, after: of the calibrated simulation, and of it with the effects that the other blocks chose
    without, with_it: for each named term, on its wheels
    """

    before: float
    after: float
    without: tuple[float, ...]
    with_it: tuple[float, ...]


def hold_out(search: Search, named: Fit, noise: Noise, groups: Sequence[Group]) -> HeldOut:
    """Choose and fit on all folds but one, measure on that one, for each fold in turn.

    `groups` are the grid as it was before any data refined it.
    """
    dictionary = search.dictionary
    count, wheels = len(dictionary.gram), len(noise.deviation)
    totals = np.zeros((2, wheels))
    by_term = np.zeros((2, len(named.terms), wheels))
    kept = dictionary.groups
    for fold in range(count):
        others = [f for f in range(count) if f != fold] or [fold]
        train = Search(dictionary, search.nuisance, noise.weights, others)
        train.threshold = search.threshold
        dictionary.groups = list(groups)
        chosen = _chosen(train)
        dictionary.groups = kept
        without = squares(train, train.fit(()), fold)
        with_all = squares(train, train.fit(chosen), fold)
        totals += np.stack((without, with_all))
        for index, term in enumerate(named.terms):
            rest = tuple(t for t in chosen if t.name != term.name)
            by_term[0, index] += squares(train, train.fit(rest), fold)
            by_term[1, index] += with_all
    counts = dictionary.counts.sum(axis=0)
    rms = np.sqrt(totals.sum(axis=1) / counts.sum())
    on = [list(term.wheels) for term in named.terms]
    pairs = [[float(np.sqrt(by_term[k, i, w].sum() / counts[w].sum())) for i, w in enumerate(on)] for k in (0, 1)]
    return HeldOut(float(rms[0]), float(rms[1]), tuple(pairs[0]), tuple(pairs[1]))


def _chosen(train: Search) -> tuple[Term, ...]:
    """Choose by the same rules on these folds alone, on the grid: forwards, with one look at what pairs do better."""
    terms: tuple[Term, ...] = ()
    for _ in range(3):
        found = best_per_family(train, terms)
        if not found:
            break
        trials = [(*terms, t) for _, t in found[:3]]
        if len(terms) == 1:
            trials += [(a, b) for _, a in best_per_family(train, ())[:6] for _, b in best_per_family(train, (a,))[:2]]
        ranked = sorted((train.fit(trial) for trial in trials), key=train.score, reverse=True)
        best = next((fit for fit in ranked if acceptable(train, fit)), None)
        if best is None or not enough(train, best, train.fit(terms)):
            break
        terms = best.terms
    return terms
