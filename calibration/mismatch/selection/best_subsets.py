"""Sets of names: the best of each size, and when a larger one has earned its further names.

Sets of up to three terms are searched: singles, pairs that are best together (not only one after the other), and a
third on the best pairs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.regression.residuals import residual_of, size_of
from regolithd.calibration.mismatch.selection.shape_optimisation import refined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search, Term

FURTHER_SHARE = 0.01
"""A further term must gain this share of what the others gained: no form is nature's to the last percent."""
TELLING_SHARE = 0.1
"""Unless it takes this share of all that they left."""
BESIDE_THE_UNKNOWN = 0.1
"""Of what a curve without a name gains, the least that a name beside it must gain: what leaks from one is less."""
UNNAMED_BY = 16.0
"""Likewise for a curve, of which there are more and freer ones."""
WORTH_A_NAME = 0.02
"""Of the predicted channel's mean magnitude: an effect with a smaller root mean square on its wheels is no finding."""
FURTHER_NAME = 2.0
"""A second name is chosen beside a first that was chosen too: it needs a little more."""


def best_per_family(search: Search, given: Sequence[Term], *, named: bool = True) -> list[tuple[float, Term]]:
    """Return each candidate's best shape and wheels beside `given`, by gain less price, best first."""
    wheels = len(search.weights)
    taken = {(t.name, t.wheels) for t in given}
    best: dict[str, tuple[float, Term]] = {}
    groups = [group for group in search.dictionary.groups if group.named == named]
    for gain, term in search.conditional(given, groups):
        if (term.name, term.wheels) in taken or any(_same_fault(term, t) for t in given):
            continue
        score = gain - term.price(wheels)
        key = term.name if named else f"{term.name} {term.group.flavour} {len(term.wheels)}"
        if key not in best or score > best[key][0]:
            best[key] = (score, term)
    return sorted(best.values(), key=lambda found: -found[0])


def _same_fault(one: Term, other: Term) -> bool:
    """Say whether two terms are one family on overlapping wheels."""
    return one.group.named and one.name == other.name and bool(set(one.wheels) & set(other.wheels))


def acceptable(search: Search, fit: Fit) -> bool:
    """Say whether every coefficient has its sign and every term is worth a name."""
    for index, term in enumerate(fit.terms):
        values = fit.coefficients[fit.of_term(index)]
        if any(sign * value < 0 for sign, value in zip(term.group.signs, values, strict=True)):
            return False
        if term.group.named and size_of(search, fit, index) < WORTH_A_NAME:
            return False
        if term.group.evidence is not None and not _seen_here_too(search, fit, index):
            return False
    return True


def _seen_here_too(search: Search, fit: Fit, index: int) -> bool:
    """Say whether a fault of another channel shows in the predicted one too, and there as large as at home."""
    term = fit.terms[index]
    without = search.fit([t for i, t in enumerate(fit.terms) if i != index])
    assert term.group.evidence is not None  # noqa: S101  # the caller asked
    scale = search.dictionary.scale[list(term.group.columns)]
    here = float((fit.coefficients[fit.of_term(index)] / scale)[0])
    home = float(term.group.evidence[1][list(term.wheels)][0])
    return fit.gain - without.gain > UNNAMED_BY and 0.4 < here / home < 2.5


def polished(search: Search, terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return the terms with each one's shape, and grid, at its best beside the others; twice round."""
    terms = list(terms)
    for _ in range(2 if len(terms) > 1 else 1):
        for index, term in enumerate(terms):
            others = terms[:index] + terms[index + 1 :]
            family = [g for g in search.dictionary.groups if g.named and g.name == term.name]
            found = [(g, t) for g, t in search.conditional(others, family) if t.wheels == term.wheels]
            if found:
                terms[index] = _worthwhile(search, others, found)
            terms[index] = refined(search, others, terms[index])
    return tuple(terms)


def _worthwhile(search: Search, others: Sequence[Term], found: Sequence[tuple[float, Term]]) -> Term:
    """Return the shape that gains most, of a kind in which the effect is worth a name, if there is one."""
    kinds: dict[frozenset[str], Term] = {}
    for _, term in sorted(found, key=lambda pair: -pair[0]):
        kinds.setdefault(frozenset(term.group.shape), term)
    best = list(kinds.values())
    for term in best if len(best) > 1 else ():
        if size_of(search, search.fit((*others, term)), len(others)) >= WORTH_A_NAME:
            return term
    return best[0]


def best_named(search: Search) -> list[Fit]:
    """Return the best named set of each size, from none to three, each polished."""
    none = search.fit(())
    singles = _polished_best(search, [(t,) for _, t in best_per_family(search, ())[:5]])
    if not singles:
        return [none]
    seeds = [fit.terms[0] for fit in singles] + [t for s, t in best_per_family(search, ())[5:] if s > 0]
    pairs = [(seed, t) for seed in seeds for _, t in best_per_family(search, (seed,))[:4]]
    best_pairs = _polished_best(search, _distinct(search, pairs)[:4])
    if not best_pairs:
        return [none, singles[0]]
    triples = [(*fit.terms, t) for fit in best_pairs[:2] for _, t in best_per_family(search, fit.terms)[:2]]
    best_triples = _polished_best(search, _distinct(search, triples)[:1])
    return [none, singles[0], best_pairs[0], *best_triples[:1]]


def _distinct(search: Search, sets: Sequence[tuple[Term, ...]]) -> list[tuple[Term, ...]]:
    """Return sets ordered by score, one for each combination of names and wheels."""
    fits = sorted((search.fit(terms) for terms in sets), key=search.score, reverse=True)
    seen: dict[frozenset[tuple[str, tuple[int, ...]]], tuple[Term, ...]] = {}
    for fit in fits:
        seen.setdefault(frozenset((t.name, t.wheels) for t in fit.terms), fit.terms)
    return list(seen.values())


def _polished_best(search: Search, sets: Sequence[tuple[Term, ...]]) -> list[Fit]:
    fits = [search.fit(polished(search, terms)) for terms in sets]
    return sorted((fit for fit in fits if acceptable(search, fit)), key=search.score, reverse=True)


def enough(search: Search, more: Fit, less: Fit) -> bool:
    """Say whether a larger set has earned its further names."""
    remaining = float(np.sum(residual_of(search, less) ** 2 * search.weights))
    worthwhile = min(FURTHER_SHARE * less.gain, TELLING_SHARE * remaining)
    faulty = wandering(more)
    if any(term.group.evidence is None and set(term.wheels) <= faulty for term in more.terms):
        worthwhile = BESIDE_THE_UNKNOWN * less.gain
    further = FURTHER_NAME if less.terms else 0.0
    needed = max(search.threshold + further, worthwhile) * (len(more.terms) - len(less.terms))
    return search.score(more) - search.score(less) > needed


def wandering(fit: Fit) -> set[int]:
    """Return the wheels of which a sensor wanders.

    How it did is known only as well as it shows it itself: what that leaves on its wheel is neither a name nor unknown.
    """
    return {w for term in fit.terms if term.group.evidence is not None for w in term.wheels}
