"""Collinearity: effects and free parameters of which one could stand for another in this recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.inference.other_answers.experiment import with_experiment
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import of_grid
from regolithd.calibration.mismatch.regression.normal_equations import SINGULAR
from regolithd.calibration.mismatch.regression.nuisance import EXACT
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse, schur_complement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Indistinguishable
    from regolithd.calibration.mismatch.experiments.choice import Experimenter
    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.regression.group import Fit, Group
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def collinear_sets(
    equations: NormalEquations,
    given: Fit,
    experimenter: Experimenter,
    others: Sequence[Alternative] = (),
    taken: frozenset[str] = frozenset(),
) -> tuple[Indistinguishable, ...]:
    """Return sets of effects of which each could stand for each, were it there at a size worth telling apart.

    What the simulation's free parameters can imitate belongs to a set as well: constant speed on flat ground makes
    Coulomb friction, viscous friction and cohesion one. A set with one of the names in `taken` is left out.
    """
    terms = representatives(equations)
    beside = Beside(equations, given, [term for shapes in terms.values() for term in shapes])
    like = {one: {two for two in terms if two != one and imitates(beside, terms[one], terms[two])} for one in terms}
    found, seen = [], set()
    for name in terms:
        members = _mutual(name, like)
        if frozenset(members) in seen:
            continue
        seen.add(frozenset(members))
        first = [terms[member][0] for member in members]
        names = (*members, *parameters_like(equations, given.terms, first))
        if len(names) > 1 and not taken & set(names):
            found.append(with_experiment(names, experimenter.on(equations), given.terms, first, others))
    return tuple(found)


def _mutual(name: str, like: dict[str, set[str]]) -> list[str]:
    """Return a set of effects, in alphabetical order, of which each is like each."""
    members = {name}
    for other in sorted(like[name]):
        if all(other in like[member] and member in like[other] for member in members):
            members.add(other)
    return sorted(members)


def representatives(equations: NormalEquations) -> dict[str, list[Term]]:
    """Return every shape of each candidate's grid that all wheels may share, if it has few columns."""
    families: dict[tuple[str, bool], list[Group]] = {}
    most = equations.thresholds.most_imitating_columns
    for group in equations.design.groups:
        shared = "all" in group.sharing or len(equations.weights) == 1
        if group.named and shared and len(group.columns) <= most:
            families.setdefault(group.law, []).append(group)
    found: dict[str, list[Term]] = {}
    for groups in families.values():
        on_grid = of_grid(equations.problem, groups)
        found.setdefault(groups[0].name, []).extend(Term(group, equations.all_wheels) for group in on_grid)
    return found


def energy_apart(equations: NormalEquations, given: Sequence[Term], term: Term) -> float:
    """Return the Δχ² of a term outside the span of all else, at the size worth telling apart."""
    size = equations.thresholds.effect_to_tell_apart * equations.problem.mean_size
    _, complement = equations.own_and_complement(given, term)
    return float(complement[0, 0] * size**2)


class Beside:
    """Terms on all wheels, each held against each beside a fit: one Schur complement serves all pairs."""

    def __init__(self, equations: NormalEquations, given: Fit, terms: Sequence[Term]) -> None:
        """Compute what is left of the columns of all terms outside the span of the fit."""
        self.thresholds = equations.thresholds
        at = np.array(sorted({column for term in terms for column in term.group.columns}), np.int64)
        self._place = {int(column): place for place, column in enumerate(at)}
        products, fit = equations.products(at, at).sum(axis=0), equations.fit(given.terms)
        self._energy = np.diag(products)
        self._left = schur_complement(products, equations.cross(fit.columns, at, equations.all_wheels), fit.covariance)
        self._size = (equations.thresholds.effect_to_tell_apart * equations.problem.mean_size) ** 2

    def apart(self, term: Term, other: Term | None = None) -> float:
        """Return the Δχ² of a term outside the span of the fit, and of another, at the size worth telling apart."""
        of = self._place[term.group.columns[0]]
        left = float(self._left[of, of])
        if other is not None:
            at = [self._place[column] for column in other.group.columns]
            at = [place for place in at if self._left[place, place] > SINGULAR * self._energy[place]]
            if len(at) == 1:
                left -= float(self._left[of, at[0]] ** 2 / self._left[at[0], at[0]])
            else:
                inverse = pseudo_inverse(self._left[np.ix_(at, at)], SINGULAR)
                left -= float(self._left[of, at] @ inverse @ self._left[at, of])
        return left * self._size


def imitates(beside: Beside, one: list[Term], two: list[Term]) -> bool:
    """Return whether some shape of `two` would pass for the middle shape of `one` one time in twenty.

    Where the free parameters hide an effect of the size worth telling apart, one that is just found is meant, unless
    that is implausibly large.
    """
    limits, term = beside.thresholds, one[len(one) // 2]
    alone = beside.apart(term)
    if alone < 2 * limits.told_apart / limits.largest_plausible_factor**2:
        return False
    factor = max(2 * limits.told_apart / alone, 1.0)
    return any(factor * beside.apart(term, other) < limits.told_apart for other in two)


def parameters_like(equations: NormalEquations, given: Sequence[Term], members: Sequence[Term]) -> list[str]:
    """Return the free parameters, by their names as effects, that could stand for every member.

    Each name once, and none of a member's own: two parameters may act alike, and one may act as a member does.
    """
    names, taken = equations.problem.simulation.parameter_effects, {member.name for member in members}
    found = [
        names[name]
        for place, name in enumerate(equations.nuisance.names)
        if name in names and _parameter_like(equations, given, members, place)
    ]
    return [name for name in dict.fromkeys(found) if name not in taken]


def _parameter_like(equations: NormalEquations, given: Sequence[Term], members: Sequence[Term], place: int) -> bool:
    """Return whether a parameter, were it as wrong as that takes, could stand for every member."""
    limits, nuisance = equations.thresholds, equations.nuisance
    free = equations.with_nuisance(nuisance.with_precision(place, 0.0))
    if max(energy_apart(free, given, member) for member in members) >= limits.told_apart:
        return False
    if len(members) > 1:
        return True
    # One effect alone is taken for a parameter only where the parameter's own uncertainty hides it.
    exact = equations.with_nuisance(nuisance.with_precision(place, EXACT))
    hidden = energy_apart(equations, given, members[0]) <= limits.told_apart
    return hidden and energy_apart(exact, given, members[0]) >= 2 * limits.told_apart
