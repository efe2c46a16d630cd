"""Best subset selection: the best set of effects of each size up to three, and the test of a larger set.

Pairs are searched as pairs, not only one effect after the other; a third is added to the best pairs. Shapes are
optimised on the way, which extends the design matrix: functions that do so return the equations as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.late_columns import SENSOR_DELAY
from regolithd.calibration.mismatch.regression.groups.smooth_groups import is_constant
from regolithd.calibration.mismatch.regression.residuals import chi2_of, relative_size
from regolithd.calibration.mismatch.selection.plausibility.causality import acts_forwards
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import explained, explained_beside
from regolithd.calibration.mismatch.selection.shape_optimisation import optimised_shape, shape_profile
from regolithd.calibration.mismatch.signal.chi_squared import quantile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Group, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.regression.screening.gains import Gains

Scored = tuple[float, "Term"]

MOST_ROUNDS = 8
"""Rounds in which the shapes of several terms are optimised, at most (a choice: two are usual at usual noise)."""
WORTH_A_ROUND = 0.5
"""Gain of the score from which another round is worth its time (a choice: e^0.25 in odds)."""


def best_of_each_candidate(equations: NormalEquations, given: Sequence[Term]) -> list[Scored]:
    """Return each candidate's best shape and wheels beside `given`, with Δχ² less penalty, best first."""
    gains = equations.gains(given, [group for group in equations.design.groups if group.named])
    several = [len(wheels) > 1 for wheels in gains.sets]
    alone = [_one_wheel_shows_alone(equations, gains, place) for place in range(len(gains.groups))]
    refused = np.outer(several, np.array(alone, np.bool_))
    for term in given:
        same = np.array([group.subject == term.group.subject for group in gains.groups], np.bool_)
        refused |= np.outer([not set(wheels).isdisjoint(term.wheels) for wheels in gains.sets], same)
    return _best_of_each(gains.where(~refused).families(lambda group: group.law))


def _one_wheel_shows_alone(equations: NormalEquations, gains: Gains, place: int) -> bool:
    """Return whether each wheel has its own coefficients of a group, and only one wheel's are not zero.

    On several wheels such a law gains a little more than on one, by chance: the others have to show it too.
    """
    group = gains.groups[place]
    if group.acting is None or "one" not in group.sharing:
        return False
    of_sets = list(zip(gains.values[:, place].tolist(), gains.sets, strict=True))
    alone = max((gain for gain, wheels in of_sets if len(wheels) == 1), default=0.0)
    shared, on = max(((gain, wheels) for gain, wheels in of_sets if len(wheels) > 1), default=(0.0, gains.sets[0]))
    own = group.acting[:, list(on)].sum(axis=0)
    further = int(own.sum() - own.max())  # coefficients of all but one wheel
    return min(alone, shared, further) > 0 and shared - alone < chi2_quantile(equations, further)


def best_of_each_smooth_term(equations: NormalEquations, given: Sequence[Term]) -> list[Scored]:
    """Return the best smooth term of each covariate, coupling and number of wheels, likewise.

    Of those over what was before only what acts forwards in time.
    """
    taken = {(term.name, term.wheels) for term in given}
    gains = equations.gains(given, [group for group in equations.design.groups if not group.named])
    left = gains.where([[(group.name, wheels) not in taken for group in gains.groups] for wheels in gains.sets])
    over = left.families(lambda group: (group.name, group.coupling))
    best = _best_of_each([some for each in over for some in each.by_number_of_wheels()])
    return [(score, term) for score, term in best if acts_forwards(equations, given, term)]


def _best_of_each(families: Sequence[Gains]) -> list[Scored]:
    """Return the best term of each family by Δχ² less penalty, best first."""
    best = [gains.largest_score() for gains in families]
    return sorted((each for each in best if each is not None), key=lambda scored: -scored[0])


def acceptable(equations: NormalEquations, fit: Fit) -> bool:
    """Return whether every coefficient has its sign and every named effect is large enough, at home too."""
    return all(_acceptable_term(equations, fit, index) for index in range(len(fit.terms)))


def _acceptable_term(equations: NormalEquations, fit: Fit, index: int) -> bool:
    term, values = fit.terms[index], fit.coefficients[fit.of_term(index)]
    if any(sign * value < 0 for sign, value in zip(term.group.signs, values, strict=True)):
        return False
    if not physically_plausible(equations, fit, index):
        return False
    if term.group.named and not large_enough(equations, fit, index):
        return False
    if not _gains_by_its_covariate(equations, fit, index) or _is_a_parameter(equations, fit, index):
        return False
    return term.group.own_channel is None or _agrees_with_own_channel(equations, fit, index)


def large_enough(equations: NormalEquations, fit: Fit, index: int) -> bool:
    """Return whether an effect is a finding by its size; a smaller delay is one if it is as clear as a curve is."""
    limits, term = equations.thresholds, fit.terms[index]
    size = relative_size(equations, fit, index)
    if size >= limits.smallest_effect or term.name != SENSOR_DELAY:
        return size >= limits.smallest_effect
    gained = equations.score(fit) - equations.score(equations.fit(fit.without(index)))
    return size >= limits.smallest_delay_effect and gained > limits.smooth_term_entry


def _gains_by_its_covariate(equations: NormalEquations, fit: Fit, index: int) -> bool:
    """Return whether a term gains more than its law without its covariate by what the choice of its shape costs."""
    term = fit.terms[index]
    candidate = term.group.candidate
    without = candidate.without_covariate(term.group.shape) if candidate else None
    if candidate is None or without is None:
        return True
    profile = shape_profile(equations, fit.without(index), candidate, term.wheels)
    return profile(term.group.shape) - profile(without) > term.group.selection_penalty


def _is_a_parameter(equations: NormalEquations, fit: Fit, index: int) -> bool:
    """Return whether a parameter of the simulation acts as a term does, and explains as much within its prior.

    What the term gains is then the way that the parameter need not go, and no evidence of the readings. Where another
    parameter has to leave its own prior without the term, it is evidence.
    """
    problem, nuisance = equations.problem, equations.nuisance
    names = problem.simulation.parameter_effects
    places = {place for place, name in enumerate(nuisance.names) if names.get(name) == fit.terms[index].name}
    if not places:
        return False
    rest = fit.without(index)

    def gain_beside_any(place: int) -> float:
        freed = equations.with_nuisance(nuisance.widened([place], problem))
        return freed.fit(fit.terms).delta_chi2 - freed.fit(rest).delta_chi2

    strained = set(nuisance.contradicting_their_priors(equations.fit(rest), problem).tolist())
    within = places - strained
    if within and strained - set(nuisance.contradicting_their_priors(fit, problem).tolist()):
        return False
    return any(gain_beside_any(place) < equations.thresholds.lead_margin for place in within)


def physically_plausible(equations: NormalEquations, fit: Fit, index: int) -> bool:
    """Return whether a term's candidate calls its coefficients possible."""
    term, values = fit.terms[index], fit.coefficients[fit.of_term(index)]
    if term.group.candidate is None:
        return True
    physical = (values / equations.design.scale[list(term.group.columns)]).tolist()
    return term.group.candidate.plausible(equations.problem, term.group.shape, physical)


def _agrees_with_own_channel(equations: NormalEquations, fit: Fit, index: int) -> bool:
    """Return whether another channel's fault shows in the predicted one too, and is about as large as there."""
    term, limits = fit.terms[index], equations.thresholds
    without = equations.fit(fit.without(index))
    assert term.group.own_channel is not None  # noqa: S101  # the caller asked
    scale = equations.design.scale[list(term.group.columns)]
    predicted = float((fit.coefficients[fit.of_term(index)] / scale)[0])
    own = float(term.group.own_channel[1][list(term.wheels)][0])
    significant = fit.delta_chi2 - without.delta_chi2 > limits.smooth_term_entry
    return significant and limits.own_channel_ratio_low < predicted / own < limits.own_channel_ratio_high


def optimised_shapes(equations: NormalEquations, terms: Sequence[Term]) -> tuple[NormalEquations, tuple[Term, ...]]:
    """Return the terms with each one's shape, from the grid and between its points, at its best.

    The terms are optimised one after the other, in rounds, as long as these gain: what two of them have in common, one
    gives up to the other in small steps.
    """
    terms, reached = list(terms), -float("inf")
    for _ in range(MOST_ROUNDS if len(terms) > 1 else 1):
        for index, term in enumerate(terms):
            others = terms[:index] + terms[index + 1 :]
            family = family_of(term, others, equations.design.groups)
            found = [(gain, t) for gain, t in equations.further(others, family) if t.wheels == term.wheels]
            equations, terms[index] = _best_of_kinds(equations, others, found) if found else (equations, term)
        before, reached = reached, equations.score(equations.fit(terms))
        if reached - before < WORTH_A_ROUND:
            break
    return equations, tuple(terms)


def family_of(term: Term, others: Sequence[Term], groups: Sequence[Group]) -> list[Group]:
    """Return the groups of a term's law in other shapes; of delays not those of a column that is late already."""
    taken = {other.group.subject for other in others}
    return [group for group in groups if group.named and group.law == term.group.law and group.subject not in taken]


def _best_of_kinds(
    equations: NormalEquations, others: Sequence[Term], found: Sequence[Scored]
) -> tuple[NormalEquations, Term]:
    """Return the shape with most Δχ² less its prior's, optimised, and equations that have its columns.

    A shape of another kind, with other numbers, is optimised too where it is behind by no more than the points of its
    grid miss. A kind in which the effect is too small is left out, if there is another.
    """
    best: dict[frozenset[str], tuple[float, Term]] = {}
    for gain, term in found:
        scored = gain - term.group.selection_penalty, term
        kind = frozenset(term.group.shape)
        best[kind] = max(best.get(kind, scored), scored, key=lambda pair: pair[0])
    kinds = sorted(best.values(), key=lambda pair: -pair[0])
    large = [each for each in kinds if _is_large(equations, others, each[1])] if len(kinds) > 1 else []
    best_fit = equations.fit((*others, (large or kinds)[0][1]))
    near = (large or kinds)[0][0] - equations.thresholds.form_misfit * best_fit.delta_chi2
    optimised: list[tuple[float, Term]] = []
    for score, term in large or kinds[:1]:
        if score >= near:
            equations, shaped = optimised_shape(equations, others, term)
            optimised.append((equations.score(equations.fit((*others, shaped))), shaped))
    return equations, max(optimised, key=lambda pair: pair[0])[1]


def _is_large(equations: NormalEquations, others: Sequence[Term], term: Term) -> bool:
    return large_enough(equations, equations.fit((*others, term)), len(others))


def best_subsets(equations: NormalEquations) -> tuple[NormalEquations, list[Fit]]:
    """Return the best acceptable set of each size, from none to three effects, shapes optimised."""
    limits, none = equations.thresholds, equations.fit(())
    first = best_of_each_candidate(equations, ())[: limits.polished_singles]
    equations, polished = _optimised(equations, [(term,) for _, term in first])
    singles = [fit for fit in polished if acceptable(equations, fit)]
    # Of two columns that are late, one alone may fit badly where the simulation is linearised with both on time.
    late = [] if equations.problem.late is None else [term for _, term in first if term.settled_in(equations.problem)]
    # Alone, one of two effects may have the wrong sign, or less than it gains without its covariate.
    seeds = [fit.terms[0] for fit in polished if equations.score(fit) > 0 or acceptable(equations, fit)] + late
    if not seeds:
        return equations, [none]
    rest = best_of_each_candidate(equations, ())[limits.polished_singles :]
    seeds += [term for score, term in rest if score > 0]
    pairs = [
        (seed, term) for seed in seeds for _, term in best_of_each_candidate(equations, (seed,))[: limits.pair_breadth]
    ]
    equations, best_pairs = _best_optimised(equations, _worth_polishing(equations, _distinct(equations, pairs)))
    if not best_pairs:
        return equations, [none, *singles[:1]]
    triples = [
        (*fit.terms, term)
        for fit in best_pairs[: limits.triple_breadth]
        for _, term in best_of_each_candidate(equations, fit.terms)[: limits.triple_breadth]
    ]
    equations, best_triples = _best_optimised(equations, _distinct(equations, triples)[:1])
    return equations, [none, *singles[:1], best_pairs[0], *best_triples[:1]]


def _worth_polishing(equations: NormalEquations, pairs: Sequence[tuple[Term, ...]]) -> Sequence[tuple[Term, ...]]:
    """Return the best of pairs that are ordered by score: as many as usual, and more that are behind by little.

    Where the noise is small, that is what the shapes of the grid miss of a law.
    """
    limits = equations.thresholds
    scores = [equations.score(equations.fit(pair)) for pair in pairs[: limits.most_polished_pairs]]
    least = scores[0] * (1 - limits.further_share) if scores else 0.0
    return pairs[: max(sum(score > least for score in scores), limits.polished_pairs)]


def _distinct(equations: NormalEquations, sets: Sequence[tuple[Term, ...]]) -> list[tuple[Term, ...]]:
    """Return sets ordered by score, one for each combination of names and wheels."""
    fits = sorted((equations.fit(terms) for terms in sets), key=equations.score, reverse=True)
    seen: dict[frozenset[tuple[str, tuple[int, ...]]], tuple[Term, ...]] = {}
    for fit in fits:
        seen.setdefault(frozenset((term.name, term.wheels) for term in fit.terms), fit.terms)
    return list(seen.values())


def _best_optimised(equations: NormalEquations, sets: Sequence[tuple[Term, ...]]) -> tuple[NormalEquations, list[Fit]]:
    """Return the acceptable ones of these sets with optimised shapes, by score."""
    equations, fits = _optimised(equations, sets)
    return equations, [fit for fit in fits if acceptable(equations, fit)]


def _optimised(equations: NormalEquations, sets: Sequence[tuple[Term, ...]]) -> tuple[NormalEquations, list[Fit]]:
    """Return these sets with optimised shapes, by score."""
    fits = []
    for terms in sets:
        equations, optimised = optimised_shapes(equations, terms)
        fits.append(equations.fit(optimised))
    return equations, sorted(fits, key=equations.score, reverse=True)


def passes_entry_test(equations: NormalEquations, more: Fit, less: Fit, entry_threshold: float) -> bool:
    """Return whether a larger set scores enough more than a smaller one for its further effects.

    No law is exact to the last percent, so that a further effect must gain a share of what the others explain. Where a
    law of the smaller set was bent away from its usual form, that has gained what its usual form misses: laws in their
    usual form that enter beside it are better ones.
    """
    limits = equations.thresholds
    remaining = float(chi2_of(equations, less).sum())
    misfit = limits.further_share * _explained_beside(equations, less, more)
    worthwhile = min(misfit, limits.remaining_share * remaining)
    faulty = wheels_of_faulty_sensors(more)
    if any(term.group.own_channel is None and set(term.wheels) <= faulty for term in more.terms):
        worthwhile = limits.beside_smooth_share * less.delta_chi2
    beside_a_choice = limits.further_term_entry if less.terms else 0.0
    further, told = len(more.terms) - len(less.terms), equations.score(less)
    entry = (entry_threshold + beside_a_choice) * further
    gained = equations.score(more) - told
    if gained > max(entry, worthwhile * further):
        return True
    bent = gained > entry and any(_is_bent(equations, term.group) for term in less.terms)
    return bent and equations.score(_in_usual_form(equations, more)) - told > entry


def _explained_beside(equations: NormalEquations, less: Fit, more: Fit) -> float:
    """Return the Δχ² of a smaller set of which the further effects of a larger one can hold a share as its misfit.

    All of it, where the larger one has not the effects of the smaller one.
    """
    known = {term.group.subject for term in less.terms}
    further = [term for term in more.terms if term.group.subject not in known]
    if len(further) != len(more.terms) - len(less.terms):
        return explained(equations, less)
    return explained_beside(equations, less, further)


def _is_bent(equations: NormalEquations, group: Group) -> bool:
    """Return whether a law was moved away from its usual form."""
    return group.candidate is not None and bool(group.candidate.unusual(equations.problem, group.shape))


def _in_usual_form(equations: NormalEquations, fit: Fit) -> Fit:
    """Return the fit of the same effects, each that was bent with the best of its usual shapes."""
    for index, term in enumerate(fit.terms):
        if _is_bent(equations, term.group):
            others = fit.without(index)
            family = family_of(term, others, equations.design.groups)
            usual = [group for group in family if not _is_bent(equations, group)]
            found = [pair for pair in equations.further(others, usual) if pair[1].wheels == term.wheels]
            if found:
                best = max(found, key=lambda pair: pair[0])[1]
                fit = equations.fit((*fit.terms[:index], best, *fit.terms[index + 1 :]))
    return fit


def entry_cost(
    equations: NormalEquations, terms: Sequence[Term], entry_threshold: float, of_smooth_term: float | None = None
) -> float:
    """Return what terms had to gain to enter: a threshold for each name, and one for each smooth term.

    The latter is `smooth_term_entry` unless told. A constant is one law, as a name is, and was not chosen among curves
    over many covariates.
    """
    smooth = equations.thresholds.smooth_term_entry if of_smooth_term is None else of_smooth_term
    return sum(entry_threshold if term.group.named or is_constant(term) else smooth for term in terms)


def wheels_of_faulty_sensors(fit: Fit) -> set[int]:
    """Return the wheels with a named fault of another channel.

    The fault's course is known only as well as that channel shows it: what it leaves on its wheel proves nothing.
    """
    return {wheel for term in fit.terms if term.group.own_channel is not None for wheel in term.wheels}


def chi2_quantile(equations: NormalEquations, columns: int) -> float:
    """Return the Δχ² that so many coefficients gain by chance at the level of a single test."""
    return quantile(columns, equations.thresholds.single_test_level)
