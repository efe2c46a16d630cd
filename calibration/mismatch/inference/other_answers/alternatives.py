"""Other answers to the same recording: one name less, one more, or one in another's place, and how far they are behind.

Two answers are compared by their evidence: the score of all their terms (Δχ² less the penalties), less what every term
had to gain to enter. A term that only just entered leaves a small margin to the answer without it; an effect that
another explains almost as well leaves a small margin to the answer with that one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.regression.groups.smooth_groups import is_constant
from regolithd.calibration.mismatch.selection.best_subsets import (
    acceptable,
    best_of_each_candidate,
    best_of_each_smooth_term,
    entry_cost,
    optimised_shapes,
)
from regolithd.calibration.mismatch.selection.by_region.region_search import schwarz_surcharge
from regolithd.calibration.mismatch.selection.decision import UNEXPLAINED, answer_names
from regolithd.calibration.mismatch.selection.plausibility.changed_parameters import (
    drop_what_a_changed_parameter_explains,
)
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import law_misfit
from regolithd.calibration.mismatch.selection.plausibility.pulled_parameters import drop_what_pulls_parameters_out
from regolithd.calibration.mismatch.selection.slow_noise import apart, score_beside_slow_noise
from regolithd.calibration.mismatch.selection.smooth_terms import (
    drop_what_a_curve_explains,
    power_share,
    weigh_against_smooth_terms,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.selection.decision import Decision

NEVER: tuple[float, tuple[Term, ...]] = (float("inf"), ())
TRIED_BESIDE_A_CURVE = 3
"""Names that are tried with a curve of their own beside them, in the place of a curve alone (a choice)."""
LARGEST_MARGIN = 40.0
"""Margin beyond which an answer is no alternative: it is e^20 times less probable."""


@dataclass(frozen=True)
class Alternative:
    """Another answer.

    Attributes
    ----------
    effects: its names, sorted; "unexplained" stands for a smooth term
    margin: by how much its evidence is behind that of the answer that was given, in Δχ²; negative: it is ahead
    terms: of its fit, where the readings do not contradict the priors
    parameters: that were stated wrongly, if this one is right
    """

    effects: tuple[str, ...]
    margin: float
    terms: tuple[Term, ...] = ()
    parameters: tuple[str, ...] = ()


def alternatives(decision: Decision, *, refused: bool = False) -> tuple[Alternative, ...]:
    """Return the other answers of one step's difference, the best of each set of names, best first.

    With `refused` also those that held-out readings refused: their evidence still says that something is there.
    Where a law in a range was more probable than a name that holds everywhere, no further name is another answer.
    """
    best: dict[tuple[str, ...], tuple[float, tuple[Term, ...]]] = {}
    margins = _Margins(decision)
    for terms in _neighbours(decision):
        fit = decision.equations.fit(terms)
        names = _names(fit.terms)
        most = min(LARGEST_MARGIN, best.get(names, NEVER)[0])
        told = refused or frozenset(names) not in decision.refused
        possible = told and margins.least(fit) < most and _is_another(decision, names)
        if not (possible and _admissible(decision, fit)):
            continue
        margin = margins.to(fit)
        if (margin := max(margin, 0.0) if _is_over_another_covariate(decision, fit) else margin) < most:
            best[names] = margin, fit.terms
    found = [Alternative(names, margin, of) for names, (margin, of) in best.items()]
    found = _with_best_shapes(decision, found)
    found = [other for other in found if other.margin >= 0 or _stands_optimised(decision, other)]
    return tuple(sorted(found, key=lambda each: each.margin))


def _with_best_shapes(decision: Decision, others: Sequence[Alternative]) -> list[Alternative]:
    """Return the answers, the best one of names alone with the margin that it has with optimised shapes.

    Where one curve is told: it follows a law more closely than the shapes of a grid do.
    """
    behind = [other for other in others if other.margin >= 0 and other.effects and UNEXPLAINED not in other.effects]
    if not behind or not decision.unnamed or len(decision.whole.terms) > 1:
        return list(others)
    near = min(behind, key=lambda each: each.margin)
    equations, terms = optimised_shapes(decision.equations, near.terms)
    margin = _Margins(replace(decision, equations=equations)).to(equations.fit(terms))
    better = replace(near, margin=min(margin, near.margin))
    return [better if other is near else other for other in others]


def with_refused(decision: Decision) -> tuple[Alternative, ...]:
    """Return the other answers, and those that held-out readings refused as probable as this one at most, best first.

    An effect that just enters may raise the held-out error where the blocks without some of its readings miss it.
    """
    others = alternatives(decision, refused=True)
    told = [
        replace(other, margin=max(other.margin, 0.0)) if frozenset(other.effects) in decision.refused else other
        for other in others
    ]
    return tuple(sorted(told, key=lambda each: each.margin))


def with_other_statements(decision: Decision, others: tuple[Alternative, ...]) -> tuple[Alternative, ...]:
    """Return the other answers, and those with other names in which other parameters were stated wrongly, or none."""
    best = {other.effects: other for other in others}
    for each in decision.other_statements:
        names = _names(each.terms)
        if answer_names(each.instead_of) == answer_names(decision.whole.terms) != frozenset(names):
            other = Alternative(names, each.margin, parameters=each.parameters)
            best[names] = min(best.get(names, other), other, key=lambda one: one.margin)
    return tuple(sorted(best.values(), key=lambda each: each.margin))


def _is_another(decision: Decision, names: tuple[str, ...]) -> bool:
    """Return whether a set of names is another answer: other names, and beside a law in a range no further one."""
    told = answer_names(decision.whole.terms)
    further = set(names) - {UNEXPLAINED} > told - {UNEXPLAINED}
    return set(names) != told and not (decision.confined and further)


def _stands_optimised(decision: Decision, other: Alternative) -> bool:
    """Return whether an answer that is ahead passes all tests once the shapes of its effects are optimised.

    Names alone must leave nothing that is significant, and have nothing to do with what comes and goes.
    """
    equations, terms = optimised_shapes(decision.equations, [term for term in other.terms if term.group.named])
    fit = equations.fit(terms)
    if not acceptable(equations, fit):
        return False
    if not terms or len(terms) < len(other.terms):
        return True
    kept, left = weigh_against_smooth_terms(equations, fit, [equations.fit(())], decision.entry_threshold)
    return len(kept.terms) == len(terms) and not left


def _admissible(decision: Decision, fit: Fit) -> bool:
    """Return whether a set could have been the answer: its names and its curves pass the decision's own tests."""
    equations = decision.equations
    named = equations.fit([term for term in fit.terms if term.group.named])
    curves = [term for term in fit.terms if not term.group.named]
    return (
        acceptable(equations, fit)
        and (not curves or not _is_a_laws_misfit(decision, fit, named, curves[-1]))
        and (not curves or _is_large(decision, named, curves[-1]))
        and all(len(drop_what_a_curve_explains(equations, named, curve).terms) == len(named.terms) for curve in curves)
        and len(drop_what_a_changed_parameter_explains(equations, named).terms) == len(named.terms)
        and len(drop_what_pulls_parameters_out(equations, named).terms) == len(named.terms)
    )


def _is_large(decision: Decision, named: Fit, curve: Term) -> bool:
    """Return whether a curve holds a share of what names leave that is worth a finding."""
    equations = decision.equations
    beside = equations.fit((*named.terms, curve))
    return power_share(equations, beside, named) >= equations.thresholds.smooth_term_power


def _is_a_laws_misfit(decision: Decision, fit: Fit, named: Fit, curve: Term) -> bool:
    """Return whether a curve gains no more than an inexact law leaves, beside a set's names or in the place of others.

    Where the answer's names leave nothing, and the set lacks some of them, the curve stands in their place. Alone, a
    curve of their covariate always does; one in the place of several names of other covariates is no law's misfit, nor
    is a constant: it has nothing to follow another law with.
    """
    missing = [term for term in decision.named.terms if term.name not in answer_names(named.terms)]
    in_place = bool(missing) and not decision.unnamed
    if _is_over_another_covariate(decision, fit) or (in_place and is_constant(curve)):
        return False
    if in_place and not named.terms:
        of_its_covariate = all(term.imitated_over == curve.name for term in missing)
        if of_its_covariate or len(missing) > 1:
            return of_its_covariate
    instead_of = decision.named if in_place else named
    if not instead_of.terms:
        return False
    return law_misfit(decision.equations, instead_of, fit) < decision.equations.thresholds.form_misfit


def _is_over_another_covariate(decision: Decision, fit: Fit) -> bool:
    """Return whether a curve alone stands in the place of one name of another covariate, and gains no more than misfit.

    Where two covariates go together, as time and a temperature that rises, a law of one is nearly a curve over the
    other. It may be a little wrong, so that the curve is no more probable, and as probable at most. A curve over time
    follows anything.
    """
    if decision.unnamed or len(decision.named.terms) != 1 or len(fit.terms) != 1:
        return False
    (told,), (curve,) = decision.named.terms, fit.terms
    if curve.group.named or is_constant(curve) or curve.name in {"time", told.imitated_over}:
        return False
    if curve.wheels != told.wheels:
        return False
    return law_misfit(decision.equations, decision.named, fit) < decision.equations.thresholds.form_misfit


class _Margins:
    """By how much the evidence for other answers is behind that for the answer that was given.

    Of the terms that two answers do not share, the evidence is the less of that by the weights and of that where the
    noise may have any spectrum: by the weights a curve that follows slow noise has much. Spells are told from noise
    apart, and a range that stands for a law in it is not that law.
    """

    def __init__(self, decision: Decision) -> None:
        self._decision = decision
        self._by_weights_alone = {id(each.term) for each in decision.intermittent}
        self._by_weights_alone |= {id(each.region) for each in decision.confined}
        # By the identities of shared and further terms, which are kept beside: else another object could have one.
        self._beside_slow_noise: dict[tuple[tuple[int, ...], ...], tuple[tuple[tuple[Term, ...], ...], float]] = {}

    def to(self, fit: Fit) -> float:
        """Return the margin to the answer with these terms."""
        shared, own, others = self._apart(fit)
        return self._evidence(own, shared, instead=bool(others)) - self._evidence(others, shared, instead=bool(own))

    def least(self, fit: Fit) -> float:
        """Return what the margin to the answer with these terms is at least: less of a computation."""
        shared, own, others = self._apart(fit)
        return self._evidence(own, shared, instead=bool(others)) - self._by_weights(others, shared)

    def _apart(self, fit: Fit) -> tuple[Fit, tuple[Term, ...], tuple[Term, ...]]:
        """Return the fit of the terms that both answers have, and the further terms of either."""
        shared, own, others = apart(self._decision.whole.terms, fit.terms)
        return self._decision.equations.fit(shared), own, others

    def _evidence(self, further: tuple[Term, ...], shared: Fit, *, instead: bool) -> float:
        """Return the evidence for further terms, which stand in the place of others (`instead`), or of nothing."""
        by_weights = self._by_weights(further, shared)
        if not further or any(id(term) in self._by_weights_alone for term in further):
            return by_weights
        equations, terms = self._decision.equations, (shared.terms, further)
        key = tuple(tuple(map(id, each)) for each in terms)
        if key not in self._beside_slow_noise:
            self._beside_slow_noise[key] = terms, score_beside_slow_noise(equations, *terms)
        of_curve = None if instead else equations.thresholds.slow_noise_entry
        needed = entry_cost(equations, further, self._decision.entry_threshold, of_curve)
        return min(by_weights, self._beside_slow_noise[key][1] - needed)

    def _by_weights(self, further: tuple[Term, ...], shared: Fit) -> float:
        fit = self._decision.equations.fit((*shared.terms, *further))
        return _evidence(self._decision, fit) - _evidence(self._decision, shared)


def _evidence(decision: Decision, fit: Fit) -> float:
    """Return the score of a fit by the weights, less what each of its terms had to gain to enter.

    Beside regions a curve pays for its coefficients as they did, by Schwarz's criterion.
    """
    equations = decision.equations
    evidence = equations.score(fit) - entry_cost(equations, fit.terms, decision.entry_threshold)
    if any(term.group.region is not None for term in decision.unnamed):
        curves = [term for term in fit.terms if not term.group.named and term.group.region is None]
        evidence -= schwarz_surcharge(equations, fit, curves)
    return evidence


def _neighbours(decision: Decision) -> Iterator[tuple[Term, ...]]:
    """Yield the sets of terms with one less, one more, or one in another's place; of the names alone, too.

    A curve may hold what the wrong name beside it leaves: the right name needs none. And one curve, or one other name,
    may be what several names imitate, or a name and another curve, or two names.
    """
    terms, named = decision.whole.terms, tuple(term for term in decision.whole.terms if term.group.named)
    if len(named) > 1:
        yield from ((other,) for other in _further(decision, ()))
    for index in range(len(named)) if len(named) < len(terms) else ():
        rest = (*named[:index], *named[index + 1 :])
        yield from ((*rest, other) for other in _further(decision, rest))
    for _, name in best_of_each_candidate(decision.equations, ())[: TRIED_BESIDE_A_CURVE if not named else 0]:
        yield from ((name, curve) for _, curve in best_of_each_smooth_term(decision.equations, (name,))[:1])
        yield from ((name, other) for _, other in best_of_each_candidate(decision.equations, (name,))[:1])
    yield from ((*terms, more) for more in _further(decision, terms))
    for index in range(len(terms)):
        rest = (*terms[:index], *terms[index + 1 :])
        yield rest
        yield from ((*rest, other) for other in _further(decision, rest))


def _further(decision: Decision, given: tuple[Term, ...]) -> Iterator[Term]:
    """Yield the effects and the smooth term that explain most beside the given terms."""
    equations = decision.equations
    candidates = best_of_each_candidate(equations, given)[: equations.thresholds.rivals_tried]
    yield from (term for _, term in candidates)
    yield from (term for _, term in best_of_each_smooth_term(equations, given)[:1])


def _names(terms: tuple[Term, ...]) -> tuple[str, ...]:
    return tuple(sorted(answer_names(terms)))
