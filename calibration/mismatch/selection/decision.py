"""The decision: how loud the noise is, what a residual suggests, which names stay, and what is left without one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.normal_equations import add_beat, add_candidate
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.best_subsets import UNNAMED_BY, best_named, enough
from regolithd.calibration.mismatch.selection.cross_validation import that_transfer
from regolithd.calibration.mismatch.selection.sign_flip_test import naming_threshold
from regolithd.calibration.mismatch.selection.smooth_terms import without_a_name
from regolithd.calibration.mismatch.signal.noise import Noise, estimate_noise

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search, Term

Array = NDArray[np.float64]

QUICK_MEMORY = 5.0
FORCED_TERMS = 4
SMOOTH = 12
"""Columns of a curve that cannot follow the noise itself."""


@dataclass(frozen=True)
class Decision:
    """What was decided, with all that led to it."""

    search: Search
    noise: Noise
    named: Fit
    unnamed: tuple[Term, ...]
    whole: Fit
    """Named and unnamed together."""


def settle_noise(search: Search) -> tuple[Noise, Array]:
    """Estimate the noise from what is left when anything at all that explains something is taken out; return both.

    An effect that is not taken out looks like noise that never forgets, and then hides itself. So first the most
    telling terms are taken out as if the noise forgot quickly, whether they are significant or not: their few
    coefficients cost the estimate little. Then again, with that noise, only what is significant.
    """
    mask = search.dictionary.problem.mask
    noise = estimate_noise(residual_of(search, search.fit(())), mask)
    quick = Noise(noise.deviation, min(noise.memory, QUICK_MEMORY))
    terms: list[Term] = []
    for _ in range(FORCED_TERMS):
        _weigh(search, quick)
        terms += [term for _, term in _most_telling(search, terms)]
    noise = estimate_noise(residual_of(search, search.fit(terms)), mask)
    terms = []
    for _ in range(2 * FORCED_TERMS):
        _weigh(search, noise)
        found = [term for score, term in _most_telling(search, terms) if score > 0.5 * UNNAMED_BY]
        if not found:
            break
        terms += found
    left = residual_of(search, search.fit(terms))
    noise = estimate_noise(left, mask)
    _weigh(search, noise)
    return noise, left


def _weigh(search: Search, noise: Noise) -> None:
    search.weights = noise.weights
    search.refresh()


def _most_telling(search: Search, terms: Sequence[Term]) -> list[tuple[float, Term]]:
    """Return the term with the best score beside these, if there is any; of curves only the smooth ones."""
    wheels = len(search.weights)
    smooth = [group for group in search.dictionary.groups if len(group.columns) <= SMOOTH]
    scored = [(gain - term.price(wheels), term) for gain, term in search.conditional(terms, smooth)]
    return [max(scored, key=lambda pair: pair[0])] if scored else []


def seek_in_residual(search: Search, candidates: Sequence[Candidate], terms: Iterable[Term]) -> None:
    """Let candidates with too fine a grid look at the residual for their shapes."""
    problem = search.dictionary.problem
    residual = residual_of(search, search.fit(terms))
    counts = np.maximum(problem.mask.sum(axis=0), 1)
    memory = float(np.median(counts / np.maximum(search.weights * np.sum(residual**2, axis=0), 1e-300)))
    for candidate in candidates:
        if shapes := candidate.propose_shapes(problem, residual):
            quieter = [
                max(memory / candidate.autocorrelation_time_at(problem, residual, shape), 1.0) for shape in shapes
            ]
            add_candidate(search.dictionary, candidate, shapes, quieter)
    add_beat(search.dictionary, residual)
    search.refresh()


def decide(search: Search, candidates: Sequence[Candidate]) -> Decision:
    """Choose names, and say what is left without."""
    noise, left = settle_noise(search)
    none = search.fit(())
    search.threshold = naming_threshold(search, left, blocks_of_time(search.dictionary.problem, noise))
    seek_in_residual(search, candidates, ())
    sets = best_named(search)[1:]
    named = none
    for fit in sets:
        if enough(search, fit, named):
            named = fit
    named = that_transfer(search, named, search.threshold)
    named, unnamed = without_a_name(search, named, [fit for fit in sets if len(fit.terms) < len(named.terms)])
    whole = search.fit((*named.terms, *unnamed))
    noise = estimate_noise(residual_of(search, whole), search.dictionary.problem.mask)
    search.weights = noise.weights
    search.refresh()
    return Decision(search, noise, search.fit(named.terms), unnamed, search.fit((*named.terms, *unnamed)))
