"""Other names that have more evidence than the answer: what is named, where held-out readings tell two laws apart.

Two laws that hardly differ may both explain a recording, and the search may meet the wrong one first. The names of an
answer are the most probable ones that pass every test.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.inference.other_answers.alternatives import alternatives
from regolithd.calibration.mismatch.selection.best_subsets import optimised_shapes
from regolithd.calibration.mismatch.selection.decision import UNEXPLAINED, names_of
from regolithd.calibration.mismatch.selection.smooth_terms import weigh_against_smooth_terms

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.selection.decision import Decision


def likelier_names(decision: Decision) -> Decision | None:
    """Return the best answer that has more evidence than this one, None if there is none.

    It has other names or none; or by more than chance fewer names, a further one or another beside its curves, or one
    curve in the place of all names; or a curve of an answer without some of its names. Held-out readings have not been
    asked yet.
    """
    told, chance = names_of(decision), decision.equations.thresholds.lead_margin
    for other in alternatives(decision):
        if other.margin >= 0:
            break
        if UNEXPLAINED in other.effects:
            curve_for_all_names = other.effects == (UNEXPLAINED,)
            by_more_than_chance = other.margin < -chance and (UNEXPLAINED in told or curve_for_all_names)
            fewer = told > set(other.effects) and len(other.terms) < len(decision.whole.terms)
            likelier = fewer or by_more_than_chance
            found = _with_curve(decision, other) if likelier else None
        else:
            fewer = bool(other.effects) and told > set(other.effects)
            found = None if fewer and other.margin > -chance else _named(decision, other)
        if found is not None:
            return found
    return None


def _with_curve(decision: Decision, other: Alternative) -> Decision:
    """Return the decision with the names and the curve of another answer."""
    named = [term for term in other.terms if term.group.named]
    curves = tuple(term for term in other.terms if not term.group.named)
    equations = decision.equations
    return replace(decision, named=equations.fit(named), unnamed=curves, whole=equations.fit((*named, *curves)))


def _named(decision: Decision, other: Alternative) -> Decision | None:
    """Return the decision for other names, None where a curve explains them or what they leave."""
    equations, terms = optimised_shapes(decision.equations, other.terms)
    simpler, threshold = [equations.fit(decision.named.terms)], decision.entry_threshold
    named, unnamed = weigh_against_smooth_terms(equations, equations.fit(terms), simpler, threshold)
    if len(named.terms) < len(terms) or unnamed:
        return None
    return replace(decision, equations=equations, named=named, unnamed=(), whole=named)
