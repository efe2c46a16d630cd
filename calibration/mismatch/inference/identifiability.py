"""Which other effects would explain the recording as well.

A rival leaves the set only if data made *from the rival* would favour the named effect by so much less than one time
in twenty. With normal noise that needs no simulation: were the rival true, its lead would be normal about μ with
variance 4 μ, where μ is the energy of the rival's own term outside the named one's reach.
"""

from __future__ import annotations

from dataclasses import replace
from math import erf, sqrt
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Indistinguishable
from regolithd.calibration.mismatch.inference.experiment import experiment_for
from regolithd.calibration.mismatch.regression.residuals import size_of
from regolithd.calibration.mismatch.selection.best_subsets import acceptable, best_per_family, polished
from regolithd.calibration.mismatch.selection.subset_selection import Term

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search

ONE_IN_TWENTY = 0.05
CANNOT_LEAD = 10.8
"""Energy apart, below which the wrong one of two leads more than one time in twenty: (2 × 1.645)²."""
WORTH_WORRYING = 0.15
"""Of the mean magnitude of the predicted channel: the size at which two effects should be told apart."""
ABSURD = 2.0
"""How many times that size is more than anybody would overlook."""
FEW = 2
TAKEN_OVER = 0.2
"""Share of a named effect's size that another must take from it, and have itself, to stand for a part of it."""
AS_GOOD = 0.5
"""A gain smaller by less is the same, however many shapes it was chosen from."""
SLACK = 4.0
"""A lead that the choice among shapes, and forms that are not nature's, give for nothing."""


def confusions(search: Search, named: Fit, whole: Fit) -> tuple[Indistinguishable, ...]:
    """Return what could stand for what was named, and what could not be told apart were it there."""
    found = rivals(search, named)
    told = {name for one in found for name in one.effects}
    others = tuple(one for one in collinear(search, whole) if not told & set(one.effects))
    return (*found, *others)


def rivals(search: Search, named: Fit) -> tuple[Indistinguishable, ...]:
    """Return, for each named effect that has them, the set of effects that explain the recording as well."""
    found = []
    for index, term in enumerate(named.terms):
        others = [t for i, t in enumerate(named.terms) if i != index]
        members = [term]
        for _, rival in best_per_family(search, others)[:8]:
            if rival.name == term.name:
                continue
            rival_terms = polished(search, (*others, rival))
            fit = search.fit(rival_terms)
            if acceptable(search, fit) and _survives(search, named, fit, others, term):
                members.append(rival)
        told = {member.name for member in (*named.terms, *members)}
        members += [more for more in _takes_over(search, named, index) if more.name not in told]
        names = (*(member.name for member in members), *_parameters_like(search, others, members))
        if len(names) > 1:
            found.append(Indistinguishable(names, experiment_for(search, others, members)))
    return tuple(found)


def _takes_over(search: Search, named: Fit, index: int) -> list[Term]:
    """Return the effects that may be there as well: beside them the named one is smaller, and the fit as good.

    A law with a free shape can stand for two: drag that falls with warmth holds a drag that does not.
    """
    found = []
    before = size_of(search, named, index)
    likely = [more for _, more in best_per_family(search, named.terms) if more.group.evidence is None]
    for more in likely[:3]:
        fit = search.fit(polished(search, (*named.terms, more)))
        if not acceptable(search, fit) or search.score(fit) < search.score(named) - SLACK:
            continue
        left, taken = size_of(search, fit, index), size_of(search, fit, len(named.terms))
        if before - left > TAKEN_OVER * before and taken > TAKEN_OVER * before:
            found.append(fit.terms[-1])
    return found


def collinear(search: Search, given: Fit) -> tuple[Indistinguishable, ...]:
    """Return sets of effects of which one could stand for another, were it there at a size worth worrying about.

    What the simulation's free parameters can imitate belongs to a set as well: constant speed on flat ground makes
    Coulomb friction, viscous friction and cohesion one.
    """
    terms = _representatives(search)
    size = WORTH_WORRYING * search.dictionary.problem.mean_size
    like = {
        one: {two for two in terms if two != one and _imitates(search, given, terms[one], terms[two], size)}
        for one in terms
    }
    found, seen = [], set()
    for name in terms:
        # Sets of effects of which each can stand for each.
        members = {name}
        for other in sorted(like[name]):
            if all(other in like[m] and m in like[other] for m in members):
                members.add(other)
        if frozenset(members) in seen:
            continue
        seen.add(frozenset(members))
        in_order = sorted(members)
        first = [terms[member][0] for member in in_order]
        names = (*in_order, *_parameters_like(search, given.terms, first))
        if len(names) > 1:
            found.append(Indistinguishable(names, experiment_for(search, given.terms, first)))
    return tuple(found)


def _parameters_like(search: Search, given: Sequence[Term], members: Sequence[Term]) -> list[str]:
    """Return the free parameters that could stand for every member, were they as wrong as that takes."""
    nuisance, size = search.nuisance, WORTH_WORRYING * search.dictionary.problem.mean_size
    aliases = search.dictionary.problem.simulation.parameter_effects
    found = []
    for place, name in enumerate(nuisance.names):
        if name not in aliases:
            continue
        free = nuisance.precision.copy()
        free[place] = 0.0
        search.nuisance = replace(nuisance, precision=free)
        apart = [_energy_apart(search, given, member, size) for member in members]
        search.nuisance = nuisance
        if len(members) == 1 and max(apart) < CANNOT_LEAD:
            # One effect alone is taken for a parameter only where the parameter's own doubt hides it.
            known = nuisance.precision.copy()
            known[place] = 1e12
            search.nuisance = replace(nuisance, precision=known)
            if _energy_apart(search, given, members[0], size) < 2 * CANNOT_LEAD:
                apart.append(np.inf)
            search.nuisance = nuisance
            if _energy_apart(search, given, members[0], size) > CANNOT_LEAD:
                apart.append(np.inf)
        if max(apart) < CANNOT_LEAD:
            found.append(aliases[name])
    return found


def _energy_apart(search: Search, given: Sequence[Term], term: Term, size: float) -> float:
    """Return the energy of a term of this size outside the reach of all that is in the fit."""
    counts = search.weights @ search.dictionary.counts.sum(axis=0)
    return float(search.share_outside(given, term) * size**2 * counts)


def _representatives(search: Search) -> dict[str, list[Term]]:
    """Return every shape of each candidate that all wheels may share."""
    found: dict[str, list[Term]] = {}
    for group in search.dictionary.groups:
        if group.named and ("all" in group.sharing or len(search.weights) == 1) and len(group.columns) <= FEW:
            found.setdefault(group.name, []).append(Term(group, search.all_wheels))
    return found


def _imitates(search: Search, given: Fit, one: list[Term], two: list[Term], size: float) -> bool:
    """Say whether some shape of `two` would pass for the middle shape of `one`, at this size, one time in twenty.

    Where the free parameters hide an effect of this size, one that just shows is meant, unless that is absurdly large.
    """
    term = one[len(one) // 2]
    alone = _energy_apart(search, given.terms, term, size)
    if alone < 2 * CANNOT_LEAD / ABSURD**2:
        return False
    shows = max(2 * CANNOT_LEAD / alone, 1.0)
    return any(shows * _energy_apart(search, (*given.terms, other), term, size) < CANNOT_LEAD for other in two)


def _survives(search: Search, named: Fit, rival: Fit, others: Sequence[Term], term: Term) -> bool:
    """Say whether the rival, were it true, would trail by this much at least one time in twenty."""
    own = rival.terms[-1]
    candidate, shape = own.group.candidate, own.group.shape
    # What speaks against a rival beforehand is not what the recording says against it.
    beforehand = candidate.prior_penalty(search.dictionary.problem, shape) if candidate else 0.0
    lead = max(search.score(named) - search.score(rival) - beforehand - SLACK, 0.0)
    block, reach = search.beside((*others, term), own)
    values = rival.coefficients[rival.of_term(len(rival.terms) - 1)]
    apart = float(values @ (block - reach) @ values)
    if apart <= 1e-9 or named.gain - rival.gain < AS_GOOD:
        return True
    return _tail((lead + apart) / (2 * sqrt(apart))) > ONE_IN_TWENTY


def _tail(z: float) -> float:
    return 0.5 * (1 - erf(z / float(np.sqrt(2))))
