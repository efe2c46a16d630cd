"""Names beside what comes and goes: effects are chosen again beside the spells as they came and went.

A curve over time stands for spells where these are told. It has coefficients enough to follow an effect too that
changes as seldom as they do, and the noise that was estimated with the spells in it is too large. The course of the
spells, from their two levels, has one coefficient.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.inference.held_out import (
    chosen_effects,
    confirmed_beside_curves,
    groups_to_choose_from,
    with_optimised_shapes,
)
from regolithd.calibration.mismatch.inference.intermittent import constant_on
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.noise_estimation import noise_of_whitened
from regolithd.calibration.mismatch.selection.smooth_terms import drop_what_gains_little

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors
    from regolithd.calibration.mismatch.regression.group import Group
    from regolithd.calibration.mismatch.selection.decision import Decision, Intermittent


def named_beside_spells(
    decision: Decision, held_out: HeldOutErrors, grid: Sequence[Group]
) -> tuple[Decision, HeldOutErrors]:
    """Return the decision with the names that are found beside the course of its spells, and their held-out errors.

    Where that course is not known, or where no further name is found, the decision stays as it is. `grid` are the
    groups before any data optimised their shapes.
    """
    spells = [each for each in decision.intermittent if each.acting is not None]
    if not spells or len(decision.unnamed) > len(spells):
        return decision, held_out
    beside = _beside_their_course(decision, spells)
    choice = groups_to_choose_from(beside, grid)
    chosen = chosen_effects(beside.equations.with_groups(choice), beside.entry_threshold, beside.unnamed)
    equations, terms = with_optimised_shapes(beside.equations, chosen, beside.unnamed)
    told = {wheel for term in beside.unnamed for wheel in term.wheels}
    named = equations.fit([term for term in terms if not constant_on(term, told)])
    for curve in beside.unnamed:
        named = drop_what_gains_little(equations, named, curve)
    if len(named.terms) <= len(decision.named.terms):
        return decision, held_out
    whole = equations.fit((*named.terms, *beside.unnamed))
    return confirmed_beside_curves(replace(beside, equations=equations, named=named, whole=whole), grid)


def _beside_their_course(decision: Decision, spells: Sequence[Intermittent]) -> Decision:
    """Return the decision with the course of the spells in the place of curves, and the noise estimated beside it."""
    design, places = decision.equations.design.extended([each.acting for each in spells if each.acting is not None])
    equations = decision.equations.over(design)
    courses = [
        Term(replace(each.term.group, columns=(place,), signs=(0,), acting=None), each.term.wheels)
        for each, place in zip(spells, places, strict=True)
    ]
    left = residual_of(equations, equations.fit((*decision.named.terms, *courses)))
    equations = equations.weighted(noise_of_whitened(design, left).weights)
    return replace(
        decision,
        equations=equations,
        noise=equations.problem.noise_of(left),
        named=equations.fit(decision.named.terms),
        unnamed=tuple(courses),
        whole=equations.fit((*decision.named.terms, *courses)),
        intermittent=tuple(replace(each, term=course) for each, course in zip(spells, courses, strict=True)),
    )
