"""Answers that other answers outweigh: what is more probably there than not is said to be unexplained.

The tests of single names are conditions, and a recording may fail one of them narrowly while the evidence for something
is large: neither "consistent" nor a name is the most probable answer then.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.inference.alternatives import UNEXPLAINED, alternatives
from regolithd.calibration.mismatch.inference.probability import probability
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.inference.alternatives import Alternative
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

EVEN = 0.5
"""Probability below which the answer is more probably wrong than right."""


def doubted(decision: Decision) -> Decision:
    """Return the decision, with an unexplained curve where all other answers together are more probable than it.

    Of "consistent", what the most probable other answer follows is unexplained. Names make way for a curve where that
    is the most probable answer.
    """
    others = alternatives(decision)
    if decision.unnamed or probability(others, decision.equations.thresholds) >= EVEN:
        return decision
    if not decision.named.terms:
        curve = _curve_like(decision, others[0])
        return decision if curve is None else _with(decision, (), curve)
    first = others[0]
    if first.margin >= 0 or UNEXPLAINED not in first.effects:
        return decision
    names = tuple(term for term in first.terms if term.group.named)
    return _with(decision, names, *(term for term in first.terms if not term.group.named))


def _curve_like(decision: Decision, other: Alternative) -> Term | None:
    """Return the curve that can hold another answer's effect: over its covariate, on its wheels, if there is one."""
    curves = [term for _, term in best_of_each_smooth_term(decision.equations, ())]
    candidate = other.terms[0].group.candidate
    over = candidate.imitated_over if candidate else other.terms[0].name
    alike = [term for term in curves if term.name == over and term.wheels == other.terms[0].wheels]
    return next(iter((*alike, *curves)), None)


def _with(decision: Decision, names: tuple[Term, ...], *curves: Term) -> Decision:
    fit = decision.equations.fit
    return replace(decision, named=fit(names), unnamed=curves, whole=fit((*names, *curves)))
