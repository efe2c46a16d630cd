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
from regolithd.calibration.mismatch.inference.unexplained.intermittent import names_beside_spells, wheels_with_spells
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.noise_estimation import noise_of_whitened

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors
    from regolithd.calibration.mismatch.regression.group import Fit, Group
    from regolithd.calibration.mismatch.selection.decision import Decision

TURNS = 2
"""Times that names are chosen beside the spells, each with the course that these have beside the last names (a choice).
"""


def named_beside_spells(
    decision: Decision, held_out: HeldOutErrors, grid: Sequence[Group]
) -> tuple[Decision, HeldOutErrors]:
    """Return the decision with the names that are found beside the course of its spells, and their held-out errors.

    Where fewer names are found beside it, those of the decision stay that gain beside it what a name must, and where
    all do, or the course is not known, the decision stays as it is. `grid` are the groups before any data optimised
    their shapes.
    """
    if not decision.intermittent:
        return decision, held_out
    found, turns = decision, []
    for _ in range(TURNS):
        if (beside := _beside_their_course(found)) is None:
            return decision, held_out
        turns.append(beside)
        found = _chosen_beside(beside, groups_to_choose_from(beside, grid))
    if len(found.named.terms) < max(len(decision.named.terms), 1):
        beside, named = turns[0], that_gain(turns[0])
        if len(named.terms) == len(decision.named.terms):
            return decision, held_out
        found = replace(beside, named=named, whole=beside.equations.fit((*named.terms, *beside.unnamed)))
    return confirmed_beside_curves(found, grid)


def that_gain(beside: Decision) -> Fit:
    """Return the fit of those names that gain beside the curves what a name must, the worst left out first.

    The mean of spells resembles an effect, which gains nothing beside their course.
    """
    equations, named = beside.equations, beside.named
    while named.terms:
        whole = equations.score(equations.fit((*named.terms, *beside.unnamed)))
        gains = [
            whole - equations.score(equations.fit((*named.without(index), *beside.unnamed)))
            for index in range(len(named.terms))
        ]
        if min(gains) > beside.entry_threshold:
            break
        named = equations.fit(named.without(gains.index(min(gains))))
    return named


def _chosen_beside(beside: Decision, choice: Sequence[Group]) -> Decision:
    """Return the decision with the names that are chosen from these groups beside its curves."""
    chosen = chosen_effects(beside.equations.with_groups(choice), beside.entry_threshold, beside.unnamed)
    equations, terms = with_optimised_shapes(beside.equations, chosen, beside.unnamed)
    named = names_beside_spells(equations, terms, beside.unnamed)
    whole = equations.fit((*named.terms, *beside.unnamed))
    return replace(beside, equations=equations, named=named, whole=whole)


def _beside_their_course(decision: Decision) -> Decision | None:
    """Return the decision with the course of its spells in the place of curves, and the noise estimated beside it.

    The course is that of what the names leave. None, where it is not known, or is not all that stays unexplained.
    """
    left = wheels_with_spells(replace(decision, whole=decision.named))
    spells = [left.get(each.term.wheels) for each in decision.intermittent]
    known = [each.acting for each in spells if each is not None and each.acting is not None]
    if not known or len(known) < len(decision.unnamed):
        return None
    design, places = decision.equations.design.extended(known)
    equations = decision.equations.over(design)
    courses = [
        Term(replace(each.term.group, columns=(place,), signs=(0,), acting=None), each.term.wheels)
        for each, place in zip(decision.intermittent, places, strict=True)
    ]
    rest = residual_of(equations, equations.fit((*decision.named.terms, *courses)))
    equations = equations.weighted(noise_of_whitened(design, rest).weights)
    return replace(
        decision,
        equations=equations,
        noise=equations.problem.noise_of(rest),
        named=equations.fit(decision.named.terms),
        unnamed=tuple(courses),
        whole=equations.fit((*decision.named.terms, *courses)),
        intermittent=tuple(replace(each, term=term) for each, term in zip(decision.intermittent, courses, strict=True)),
    )
