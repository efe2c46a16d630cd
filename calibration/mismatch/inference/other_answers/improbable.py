"""Answers that others outweigh: a "consistent" beside much evidence for something, and a curve with little.

The tests of names are conditions, and an effect may fail one of them narrowly while the evidence for it is large: what
is more probably there than not is said to be unexplained. And a curve, or regions in its place, which are chosen among
many, may be less probable than nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.inference.other_answers.alternatives import alternatives
from regolithd.calibration.mismatch.inference.other_answers.probability import (
    decided_by_evidence,
    probability,
    probability_of_others,
)
from regolithd.calibration.mismatch.inference.statements import EVEN
from regolithd.calibration.mismatch.inference.unexplained.intermittent import unexplained_if_intermittent
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.by_region.regions import in_regions
from regolithd.calibration.mismatch.selection.decision import names_of

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision


def unexplained_if_improbable(decision: Decision) -> Decision:
    """Return the decision, with an unexplained curve where other answers outweigh it that leave something unexplained.

    Beside names it is the curve of an answer that is more probable than all others together. In the place of
    "consistent" it is the curve that can hold the effect of the most probable other answer.
    """
    equations, named = decision.equations, decision.named
    if decision.named.terms and not decision.unnamed:
        return _most_probable_with_a_curve(decision)
    # A parameter that left its prior is the answer then, and no effect that acts as it does.
    if decision.whole.terms or equations.nuisance.leaving_their_priors(named, equations.problem).size:
        return decision
    others = alternatives(decision, refused=True)
    if probability(others, equations.thresholds) >= EVEN:
        return decision
    curve = _curve_like(decision, others[0])
    return decision if curve is None else replace(decision, unnamed=(curve,), whole=equations.fit((curve,)))


def _most_probable_with_a_curve(decision: Decision) -> Decision:
    """Return the other answer that has a curve beside names and is more probable than all others together, if any.

    A curve alone is none: no law of its covariate is quite the curve.
    """
    others = alternatives(decision)
    if not others or probability_of_others(others, decision.equations.thresholds)[0] < EVEN:
        return decision
    names = [term for term in others[0].terms if term.group.named]
    curves = tuple(term for term in others[0].terms if not term.group.named)
    if not (names and curves):
        return decision
    whole = decision.equations.fit((*names, *curves))
    return replace(decision, named=decision.equations.fit(names), unnamed=curves, whole=whole)


def in_probable_regions(decision: Decision) -> Decision:
    """Return the decision with regions in the place of its curve, where they describe it better and are no chance.

    Regions are chosen among many more than the curve is: where nothing is more probable than they are, the curve may
    still be more probable than nothing.
    """
    regional = in_regions(decision)
    kept = without_improbable_curves(regional)
    return kept if kept is regional or regional is decision else without_improbable_curves(decision)


def without_improbable_curves(decision: Decision) -> Decision:
    """Return the decision without its curves, where the answer without them is more probable than all others together.

    What stands for another finding, or comes and goes, is not decided by evidence, and stays. Where a curve goes, the
    readings that it stood for are asked for what comes and goes.
    """
    if not decision.unnamed or decision.intermittent or not decided_by_evidence(decision):
        return decision
    others = alternatives(decision)
    without = names_of(replace(decision, whole=decision.named))
    if probability(others, decision.equations.thresholds) >= EVEN or frozenset(others[0].effects) != without:
        return decision
    refused = decision.refused | {names_of(decision)}
    return unexplained_if_intermittent(replace(decision, unnamed=(), whole=decision.named, refused=refused))


def over_time_if_improbable(decision: Decision) -> Decision:
    """Return the decision, with a curve over time in the place of a "consistent" that other answers outweigh.

    Its curve over another covariate was refuted by held-out readings, so that it is not that which it follows. Of what
    happened once no other time tells, and a curve over time cannot be refuted so.
    """
    equations = decision.equations
    leaving = equations.nuisance.leaving_their_priors(decision.named, equations.problem)
    if decision.whole.terms or not decision.refused or leaving.size:
        return decision
    others = [each for each in alternatives(decision, refused=True) if frozenset(each.effects) not in decision.refused]
    if probability(others, equations.thresholds) >= EVEN:
        return decision
    for score, curve in best_of_each_smooth_term(equations, ()):
        if curve.name == "time" and score > equations.thresholds.smooth_term_entry:
            return replace(decision, unnamed=(curve,), whole=equations.fit((curve,)))
    return decision


def _curve_like(decision: Decision, other: Alternative) -> Term | None:
    """Return the curve that can hold another answer's effect: over its covariate, on its wheels, if there is one."""
    curves = [term for _, term in best_of_each_smooth_term(decision.equations, ())]
    candidate = other.terms[0].group.candidate
    over = candidate.imitated_over if candidate else other.terms[0].name
    alike = [term for term in curves if term.name == over and term.wheels == other.terms[0].wheels]
    return next(iter((*alike, *curves)), None)
