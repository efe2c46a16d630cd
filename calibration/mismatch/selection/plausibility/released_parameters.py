"""Parameters that were stated wrongly, against smooth terms and names: a value beyond its prior explains more.

The prior of a parameter holds as long as its statement is right. Where the readings contradict it, it would bias the
parameter, and a curve or a name beside it is paid twice: for what it fits, and for every deviation that the parameter
need not go then. So the prior is widened; if the parameter is all that is wrong, nothing significant is left beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.regression.residuals import chi2_of, contribution
from regolithd.calibration.mismatch.selection.best_subsets import entry_cost
from regolithd.calibration.mismatch.selection.plausibility.changed_parameters import same_action
from regolithd.calibration.mismatch.selection.smooth_terms import unexplained_beside

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

    Fitted = tuple[NormalEquations, Fit]

LARGEST_MARGIN = 20.0
"""Margin beyond which an answer is no other one: it is e^10 times less probable (a choice)."""
WRONG_STATEMENT_PENALTY = 9.2
"""Δχ² charged for a parameter that was stated wrongly: odds of one in a hundred before the recording, 2 ln 100. Beyond
`Prior.reach` it grows with the square of the distance, as with a normal density of wrong values."""


@dataclass(frozen=True, eq=False)
class OtherStatement:
    """An answer that differs in what is said to have been stated wrongly.

    Attributes
    ----------
    instead_of, terms: of the answer that was given, and of this one
    parameters: that were stated wrongly, if this one is right
    margin: by how much its evidence is behind, in Δχ²; what passed every test is no less probable than what did not
    """

    instead_of: tuple[Term, ...]
    terms: tuple[Term, ...]
    parameters: tuple[str, ...]
    margin: float


@dataclass(frozen=True, eq=False)
class _Release:
    """Some names beside parameters (`places`) whose priors are widened, by its evidence and the lead that it needs."""

    equations: NormalEquations
    fit: Fit
    places: tuple[int, ...]
    evidence: float
    least: float

    @property
    def goes_too_far(self) -> bool:
        """Whether a parameter goes further than a wrong statement explains."""
        nuisance = self.equations.nuisance
        away = nuisance.prior_stds_away(self.fit)
        return any(away[place] > nuisance.furthest(place, self.equations.problem) for place in self.places)

    @cached_property
    def leaves_nothing(self) -> bool:
        """Whether nothing significant is left beside the parameters."""
        return unexplained_beside(self.equations, self.fit, tolerated=0.0) is None


def released(
    equations: NormalEquations, named: Fit, whole: Fit, entry_threshold: float
) -> tuple[Fitted | None, tuple[OtherStatement, ...]]:
    """Return equations with the priors of those parameters widened that the readings contradict, and the names' fit.

    Of parameters that could stand for each other the one whose release has most evidence is released, or all together.
    None where the readings contradict none, where the one with most evidence would go further than a wrong statement
    explains (`Prior.furthest`), where something stays unexplained all the same, or where the evidence of `whole`, names
    and curves within the priors, is larger. The second value are the other answers that were possible.
    """
    within = _evidence(equations, whole, (), entry_threshold)
    releases = list(_releases(equations, named, entry_threshold, beside_names=len(whole.terms) == len(named.terms)))
    best, most = None, within
    for each in releases:
        evidence = each.evidence - each.least
        if evidence < most:
            continue
        if each.goes_too_far:
            best, most = None, evidence  # what explains less is not released in its place
        elif each.leaves_nothing:
            best, most = each, evidence
    told, evidence = (whole.terms, within) if best is None else (best.fit.terms, best.evidence)
    names = equations.nuisance.names
    others = [OtherStatement(told, whole.terms, (), max(evidence - within, 0.0))]
    others += [
        OtherStatement(told, each.fit.terms, tuple(names[k] for k in each.places), max(evidence - each.evidence, 0.0))
        for each in releases
        if evidence - each.evidence < LARGEST_MARGIN and not each.goes_too_far and each.leaves_nothing
    ]
    return (None if best is None else (best.equations, best.fit)), tuple(others)


def _least_lead(
    equations: NormalEquations, named: Fit, removed: int | None, fit: Fit, places: Sequence[int], *, beside_names: bool
) -> float:
    """Return by how much the evidence for a wrong value has to be ahead of that for the answer within the priors.

    In the place of a name, and beside names alone, by more than chance (`lead_margin`): an effect that is just too
    small to be named bends a parameter as well. Where the parameter acts as the name does, its law is in the
    simulation, and nothing is left out of that: there the name has to be ahead by as much, unless the parameter would
    be further off than it may be at its linearisation, as where another channel knows it well.
    """
    limits = equations.thresholds
    if removed is None:
        return limits.lead_margin if beside_names else 0.0
    away = equations.nuisance.prior_stds_away(fit)
    near = [place for place in places if away[place] <= limits.furthest_linearisation_stds]
    preferred = any(_acts_as(equations, named, removed, place) for place in near)
    return -limits.lead_margin if preferred else limits.lead_margin


def _acts_as(equations: NormalEquations, named: Fit, index: int, place: int) -> bool:
    """Return whether a parameter changes the prediction as a name does.

    Not one of which the simulation says that it is something else (`parameter_effects`): soil, not friction.
    """
    problem, name = equations.problem, equations.nuisance.names[place]
    parameter, wheel = equations.nuisance.own.get(name, (name, None))
    if problem.simulation.parameter_effects.get(parameter, named.terms[index].name) != named.terms[index].name:
        return False
    changed = problem.mask if wheel is None else problem.mask & (np.array(problem.recording.wheels) == wheel)
    change = np.where(changed, problem.tangent(parameter), 0.0)
    effect = np.where(problem.mask, contribution(equations, named, index), 0.0)
    return same_action(change, effect)


def _releases(
    equations: NormalEquations, named: Fit, entry_threshold: float, *, beside_names: bool
) -> Iterator[_Release]:
    """Yield the names, and all but one, beside wider priors: of each parameter, then of all that are contradicted.

    Nothing where none is contradicted. Where one is, another may be the one that was stated wrongly: held by its own
    prior, it has left the way to those that act alike. One wheel's own deviation stands beside all names: what acts as
    a parameter on one wheel alone may well be a name.
    """
    nuisance, problem = equations.nuisance, equations.problem
    for removed in (None, *range(len(named.terms))):
        kept = named.terms if removed is None else named.without(removed)
        fit = equations.fit(kept)
        own = nuisance.contradicting_deviations(fit, problem)
        contradicted = (*nuisance.contradicting_their_priors(fit, problem).tolist(), *own)
        if not contradicted:
            continue
        for places in dict.fromkeys([*((place,) for place in (*nuisance.told(problem), *own)), contradicted]):
            freed = equations.with_nuisance(nuisance.widened(places, problem))
            fit = freed.fit(kept)
            evidence = _evidence(equations, fit, places, entry_threshold)
            least = _least_lead(equations, named, removed, fit, places, beside_names=beside_names)
            yield _Release(freed, fit, places, evidence, least)


def price_of_wrong_statement(away: float, reach: float) -> float:
    """Return the Δχ² charged for a parameter that is so far from its stated value, with its `Prior.reach`."""
    return WRONG_STATEMENT_PENALTY * max(1.0, (away / reach) ** 2)


def _evidence(equations: NormalEquations, fit: Fit, free: Collection[int], entry_threshold: float) -> float:
    """Return minus the χ² of readings and priors, less what terms and parameters outside their priors are charged."""
    nuisance = equations.nuisance
    away = nuisance.prior_stds_away(fit)
    held = np.delete(away, list(free))
    wrong = sum(price_of_wrong_statement(float(away[k]), nuisance.reach(k, equations.problem)) for k in free)
    charged = entry_cost(equations, fit.terms, entry_threshold) + sum(map(equations.penalty, fit.terms)) + wrong
    return -float(chi2_of(equations, fit).sum() + held @ held + charged)
