"""Which terms to name, and what to leave without a name.

Named sets of up to three terms are searched: singles, pairs that are best together (not only one after the other), and
a third on the best pairs. Curves without a name compete: where one covariate's curve explains clearly more than any
name does, the names have not earned it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calibration.mismatch.fill import add_beat, add_candidate
from calibration.mismatch.noise import Noise, blocks_of_time, estimate_noise
from calibration.mismatch.null import naming_threshold
from calibration.mismatch.refine import refined
from calibration.mismatch.transfer import that_transfer

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from calibration.mismatch.candidates import Candidate
    from calibration.mismatch.search import Fit, Search, Term

Array = NDArray[np.float64]

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
WORTH_A_CURVE = 0.01
"""Of the residual's power on its wheels: what is less may be significant and is still nothing to worry about."""
FURTHER_NAME = 2.0
"""A second name is chosen beside a first that was chosen too: it needs a little more."""
SHAPE_MISFIT = 0.12
"""A name whose form explains all but this share of what a free curve could explain has the right form: nature's
friction curves are not ours to the last percent."""
ONE_IN_A_THOUSAND = 3.09
"""Quantile of the normal density."""
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


def residual_of(search: Search, fit: Fit) -> Array:
    """Return measured less fitted, shape (time, wheel), 0 outside the mask."""
    dictionary = search.dictionary
    left = dictionary.residual.astype(np.float64)
    for (column, wheels), value in zip(fit.columns, fit.coefficients, strict=True):
        for w in wheels:
            left[w] -= value * dictionary.columns[column, w]
    restored = np.empty_like(left)
    restored[:, dictionary.order] = left
    return np.where(dictionary.scene.mask, restored.T, 0.0)


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
    """Return a term's root mean square on its wheels, as a share of the channel's mean magnitude."""
    scene = search.dictionary.scene
    term = fit.terms[index]
    values = contribution(search, fit, index)[:, list(term.wheels)][scene.mask[:, list(term.wheels)]]
    return float(np.sqrt(np.mean(values**2))) / scene.mean_size


def settle_noise(search: Search) -> tuple[Noise, Array]:
    """Estimate the noise from what is left when anything at all that explains something is taken out; return both.

    An effect that is not taken out looks like noise that never forgets, and then hides itself. So first the most
    telling terms are taken out as if the noise forgot quickly, whether they are significant or not: their few
    coefficients cost the estimate little. Then again, with that noise, only what is significant.
    """
    mask = search.dictionary.scene.mask
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
    scene = search.dictionary.scene
    residual = residual_of(search, search.fit(terms))
    counts = np.maximum(scene.mask.sum(axis=0), 1)
    memory = float(np.median(counts / np.maximum(search.weights * np.sum(residual**2, axis=0), 1e-300)))
    for candidate in candidates:
        if shapes := candidate.seek(scene, residual):
            quieter = [max(memory / candidate.memory_at(scene, residual, shape), 1.0) for shape in shapes]
            add_candidate(search.dictionary, candidate, shapes, quieter)
    add_beat(search.dictionary, residual)
    search.refresh()


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
                terms[index] = max(found, key=lambda pair: pair[0])[1]
            terms[index] = refined(search, others, terms[index])
    return tuple(terms)


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
    if any(term.group.evidence is None and set(term.wheels) <= _wandering(more) for term in more.terms):
        worthwhile = BESIDE_THE_UNKNOWN * less.gain
    further = FURTHER_NAME if less.terms else 0.0
    needed = max(search.threshold + further, worthwhile) * (len(more.terms) - len(less.terms))
    return search.score(more) - search.score(less) > needed


def _wandering(fit: Fit) -> set[int]:
    """Return the wheels of which a sensor wanders.

    How it did is known only as well as it shows it itself: what that leaves on its wheel is neither a name nor unknown.
    """
    return {w for term in fit.terms if term.group.evidence is not None for w in term.wheels}


def decide(search: Search, candidates: Sequence[Candidate]) -> Decision:
    """Choose names, and say what is left without."""
    noise, left = settle_noise(search)
    none = search.fit(())
    search.threshold = naming_threshold(search, left, blocks_of_time(search.dictionary.scene, noise))
    seek_in_residual(search, candidates, ())
    sets = best_named(search)[1:]
    named = none
    for fit in sets:
        if enough(search, fit, named):
            named = fit
    named = that_transfer(search, named, search.threshold)
    named, unnamed = _without_a_name(search, named, [fit for fit in sets if len(fit.terms) < len(named.terms)])
    whole = search.fit((*named.terms, *unnamed))
    noise = estimate_noise(residual_of(search, whole), search.dictionary.scene.mask)
    search.weights = noise.weights
    search.refresh()
    return Decision(search, noise, search.fit(named.terms), unnamed, search.fit((*named.terms, *unnamed)))


def _without_a_name(search: Search, named: Fit, simpler: Sequence[Fit]) -> tuple[Fit, tuple[Term, ...]]:
    """Hold the names against curves that have none.

    A curve wins in two ways: beside the names, where it finds much that they leave; and against them, where one curve
    says more than several names of unlike covariates, which then only imitate it. But a single name that leaves
    nothing significant beside it is simpler than either.
    """
    alone = best_per_family(search, (), named=False)
    if not alone:
        return named, ()
    named = _that_stay(search, named)
    curve = alone[0][1]
    by_curve = search.fit((curve,))
    imitated = len(named.terms) > 1 and search.score(by_curve) > search.score(named) + search.threshold
    imitated &= any(_covariate(term) != curve.name for term in named.terms)
    for fit in simpler if imitated else ():
        if _left_over(search, fit) is None:
            return fit, ()
    left = _left_over(search, named)
    if left is None and not imitated:
        return named, ()
    kept: tuple[Term, ...] = ()
    fit = by_curve
    for term in named.terms:
        trial = search.fit((*kept, term, curve))
        if search.score(trial) - search.score(fit) > search.threshold and acceptable(search, trial):
            kept, fit = (*kept, term), trial
    if left is None or imitated or search.score(fit) >= search.score(search.fit((*named.terms, left))):
        return _that_stand_beside(search, search.fit(kept), curve), (curve,)
    return _that_stand_beside(search, named, left), (left,)


def _left_over(search: Search, named: Fit) -> Term | None:
    """Return the curve that finds much which the names leave, if one does."""
    curves = best_per_family(search, named.terms, named=False)
    left = [(score, term) for score, term in curves if not set(term.wheels) <= _wandering(named)]
    if not left or left[0][0] <= UNNAMED_BY:
        return None
    beside = search.fit((*named.terms, left[0][1]))
    on = list(left[0][1].wheels)
    power = np.sum(contribution(search, beside, len(named.terms))[:, on] ** 2)
    if power < WORTH_A_CURVE * np.sum(residual_of(search, named)[:, on] ** 2):
        return None
    misfit = (beside.gain - named.gain) / max(beside.gain, 1e-9)
    return None if named.terms and misfit < SHAPE_MISFIT else left[0][1]


def _covariate(term: Term) -> str:
    """Return the covariate whose curve could imitate a term: that of speed, along the motion, holds a constant drag."""
    found = term.group.candidate.covariate if term.group.candidate else term.name
    return "wheel_speed" if found == "direction" else found


def _that_stand_beside(search: Search, named: Fit, curve: Term) -> Fit:
    """Leave out names that say little beside a curve that says much: what has no form leaks into every form."""
    both = search.fit((*named.terms, curve))
    unknown = both.gain - named.gain
    kept = []
    for index, term in enumerate(named.terms):
        rest = [*named.terms[:index], *named.terms[index + 1 :], curve]
        if both.gain - search.fit(rest).gain >= BESIDE_THE_UNKNOWN * unknown:
            kept.append(term)
    return search.fit(kept)


def _that_stay(search: Search, named: Fit) -> Fit:
    """Leave out changes that come and go: what wears or drives onto other soil does not heal.

    They show in a curve over time on the same wheels that is significant beside them; one covariate and one place need
    no price for having been chosen from many.
    """
    kept = []
    curves = [g for g in search.dictionary.groups if not g.named and g.name == "time" and "periodic" not in g.flavour]
    for term in named.terms:
        beside = search.conditional(named.terms, curves) if _covariate(term) == "time" else []
        more = [
            gain / (gain + named.gain)
            for gain, curve in beside
            if curve.wheels == term.wheels and gain > _by_chance(len(curve.group.columns))
        ]
        if max(more, default=0.0) < SHAPE_MISFIT:
            kept.append(term)
    return named if len(kept) == len(named.terms) else search.fit(kept)


def _by_chance(columns: int) -> float:
    """Return what that many coefficients gain one time in a thousand where nothing is (Wilson and Hilferty)."""
    spread = 2 / (9 * columns)
    return columns * (1 - spread + ONE_IN_A_THOUSAND * float(np.sqrt(spread))) ** 3
