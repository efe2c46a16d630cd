"""Errors on blocks of time that neither chose the effects nor fitted them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.other_answers.improbable import unexplained_if_improbable
from regolithd.calibration.mismatch.inference.other_answers.likelier_names import likelier_names
from regolithd.calibration.mismatch.inference.unexplained.intermittent import unexplained_if_intermittent
from regolithd.calibration.mismatch.selection.best_subsets import (
    acceptable,
    best_of_each_candidate,
    family_of,
    passes_entry_test,
)
from regolithd.calibration.mismatch.selection.cross_validation import squares_left, training_equations
from regolithd.calibration.mismatch.selection.decision import names_of, without_name
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import without_terms
from regolithd.calibration.mismatch.selection.shape_optimisation import optimised_shape, with_best_developments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Group, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

LARGEST_SET = 3
TRIED_NEXT = 3
"""Further effects tried beside those that were chosen."""
TRIED_FIRST, TRIED_SECOND = 6, 2
"""Pairs tried when one effect was chosen: so many first effects, and so many beside each."""


@dataclass(frozen=True)
class HeldOutErrors:
    """Root mean squares over all held-out blocks.

    Attributes
    ----------
    before, after: of the calibrated simulation, and of it with those named effects that the other blocks chose too
    without, with_it: for each named term, on its wheels, beside the curves of what is unexplained
    whole: of all that was found, with those curves
    """

    before: float
    after: float
    without: tuple[float, ...]
    with_it: tuple[float, ...]
    whole: float

    def without_gain(self) -> int | None:
        """Return the index of the term that lowers the held-out error least, if it or all together do not lower it.

        Of two effects that cancel each other, and a parameter, each lowers the error that the other makes.
        """
        gains = [before - after for before, after in zip(self.without, self.with_it, strict=True)]
        if not gains or (min(gains) > 0 and self.after < self.before):
            return None
        return gains.index(min(gains))


def held_out_errors(
    equations: NormalEquations,
    named: Fit,
    groups: Sequence[Group],
    entry_threshold: float,
    curves: tuple[Term, ...] = (),
) -> tuple[NormalEquations, HeldOutErrors]:
    """Choose, optimise and fit on all folds but one, measure on that one, for each fold in turn.

    `groups` are those to choose from: the grid as it was before any data optimised their shapes. What is unexplained is
    fitted by its `curves` beside them, so that it hides no name; `before` and `after` are without those. The equations
    that come back have the columns of what the folds optimised, so that none of them has to copy the others.
    """
    wheels = len(equations.weights)
    before, after = np.zeros(wheels), np.zeros(wheels)
    without, with_it = np.zeros((len(named.terms), wheels)), np.zeros(wheels)
    for fold in range(equations.design.folds):
        train = training_equations(equations, fold)
        chosen = chosen_effects(train.with_groups(groups), entry_threshold, curves)
        train, chosen = with_optimised_shapes(train, chosen, curves)
        if len(chosen) == len(named.terms) and {term.name for term in chosen} != {term.name for term in named.terms}:
            train, chosen = _or_as_named(train, chosen, named, groups, curves)
        chosen = of_names(chosen, named)
        equations = equations.over(train.design.with_groups(equations.design.groups))
        before += squares_left(train, without_terms(train, named.terms, ()), fold)
        after += squares_left(train, train.fit(chosen), fold)
        with_it += squares_left(train, train.fit((*chosen, *curves)), fold)
        for index, term in enumerate(named.terms):
            rest = tuple(other for other in chosen if other.group.subject != term.group.subject)
            without[index] += squares_left(train, without_terms(train, [term], (*rest, *curves)), fold)
    counts = equations.design.counts.sum(axis=0)
    on = [list(term.wheels) for term in named.terms]
    return equations, HeldOutErrors(
        before=_rms(before, counts),
        after=_rms(after, counts),
        without=tuple(_rms(squares[w], counts[w]) for squares, w in zip(without, on, strict=True)),
        with_it=tuple(_rms(with_it[w], counts[w]) for w in on),
        whole=_rms(with_it, counts),
    )


def of_names(chosen: tuple[Term, ...], named: Fit) -> tuple[Term, ...]:
    """Return those of the effects chosen on some folds that the answer names: the errors are of its names alone."""
    names = {term.name for term in named.terms}
    return tuple(term for term in chosen if term.name in names)


def with_optimised_shapes(
    train: NormalEquations, chosen: tuple[Term, ...], curves: tuple[Term, ...] = ()
) -> tuple[NormalEquations, tuple[Term, ...]]:
    """Return the chosen effects with their shapes optimised on the folds of `train` alone, and equations with them."""
    terms = list(chosen)
    for index, term in enumerate(chosen):
        train, terms[index] = optimised_shape(train, [*terms[:index], *terms[index + 1 :], *curves], term)
    return with_best_developments(train, terms)


def _or_as_named(
    train: NormalEquations,
    chosen: tuple[Term, ...],
    named: Fit,
    groups: Sequence[Group],
    curves: tuple[Term, ...],
) -> tuple[NormalEquations, tuple[Term, ...]]:
    """Return the answer's effects, fitted to these folds, where they score more there than as many that were chosen.

    On the grid an effect may lose to another that it beats once the shapes of both are optimised.
    """
    terms: tuple[Term, ...] = ()
    for one in named.terms:
        family = family_of(one, [other for other in named.terms if other is not one], groups)
        found = [(gain, term) for gain, term in train.further((*terms, *curves), family) if term.wheels == one.wheels]
        if not found:
            return train, chosen
        terms = (*terms, max(found, key=lambda pair: pair[0])[1])
    train, terms = with_optimised_shapes(train, terms, curves)
    as_named = train.fit((*terms, *curves))
    better = acceptable(train, as_named) and train.score(as_named) > train.score(train.fit((*chosen, *curves)))
    return train, terms if better else chosen


def _rms(squares: Array, counts: Array) -> float:
    # Rounding may leave a negative sum where the fit is exact.
    return float(np.sqrt(max(float(squares.sum()), 0.0) / counts.sum()))


def chosen_effects(train: NormalEquations, entry_threshold: float, curves: tuple[Term, ...] = ()) -> tuple[Term, ...]:
    """Choose by the same tests on these folds alone, on the grid, beside curves: forwards, and once among pairs."""
    terms: tuple[Term, ...] = ()
    first: list[tuple[float, Term]] = []
    for _ in range(LARGEST_SET):
        found = best_of_each_candidate(train, (*terms, *curves))
        if not found:
            break
        first = first or found
        trials = [(*terms, term) for _, term in found[:TRIED_NEXT]]
        if len(terms) == 1:
            trials += [
                (one, other)
                for _, one in first[:TRIED_FIRST]
                for _, other in best_of_each_candidate(train, (one, *curves))[:TRIED_SECOND]
            ]
        ranked = sorted((train.fit((*trial, *curves)) for trial in trials), key=train.score, reverse=True)
        best = next((fit for fit in ranked if acceptable(train, fit)), None)
        if best is None or not passes_entry_test(train, best, train.fit((*terms, *curves)), entry_threshold):
            break
        terms = best.terms[: len(best.terms) - len(curves)]
    return terms


def earned(decision: Decision, grid: Sequence[Group]) -> tuple[Decision, HeldOutErrors]:
    """Return the decision without names that lower no held-out error by themselves, the worst first; and its errors.

    An answer that has more evidence takes its place where its names lower it further, or are fewer. What comes and goes
    is unexplained; so is, without any name left, what is more probably there than not. `grid` are the groups before
    any data optimised their shapes.
    """
    choice = groups_to_choose_from(decision, grid)
    decision, held_out = _errors_of_names(decision, choice)
    while (idle := held_out.without_gain()) is not None:
        decision, held_out = _errors_of_names(without_name(decision, idle), choice)
    if decision.unnamed:
        decision, held_out = _errors_beside_curves(decision, choice)
    decision, held_out = _with_likelier_names(decision, held_out, choice)
    told = unexplained_if_improbable(unexplained_if_intermittent(decision))
    return (told, held_out) if told.named.terms == decision.named.terms else _errors_beside_curves(told, choice)


def beside_regions(decision: Decision, grid: Sequence[Group]) -> tuple[Decision, HeldOutErrors]:
    """Return a decision whose curves have become regions, with the names that have more evidence beside these."""
    return confirmed_beside_curves(replace(decision, refused=frozenset()), grid)


def confirmed_beside_curves(decision: Decision, grid: Sequence[Group]) -> tuple[Decision, HeldOutErrors]:
    """Return the decision, or one with names of more evidence that lower the held-out error, beside its curves."""
    choice = groups_to_choose_from(decision, grid)
    return _with_likelier_names(*_errors_beside_curves(decision, choice), choice)


def _with_likelier_names(
    decision: Decision, held_out: HeldOutErrors, choice: Sequence[Group]
) -> tuple[Decision, HeldOutErrors]:
    """Return the answer that has most evidence, of those whose names held-out readings confirm.

    Their names alone lower the held-out error further, or do so with what stays unexplained, or are fewer. Of two that
    are ahead of each other, each beside its own curves, the second is kept.
    """
    told = [names_of(decision)]
    while (other := likelier_names(decision)) is not None and names_of(other) not in told:
        other, errors = _errors_beside_curves(other, choice)
        lower = errors.after < held_out.after or errors.whole < held_out.whole
        if errors.without_gain() is None and (lower or names_of(other) < names_of(decision)):
            decision, held_out = other, errors
            told.append(names_of(decision))
        else:
            decision = replace(decision, equations=other.equations, refused=decision.refused | {names_of(other)})
    return decision, held_out


def _errors_of_names(decision: Decision, choice: Sequence[Group]) -> tuple[Decision, HeldOutErrors]:
    """Return the errors of a decision's names without its curves, and it with the columns that the folds made."""
    equations, errors = held_out_errors(decision.equations, decision.named, choice, decision.entry_threshold)
    return replace(decision, equations=equations), errors


def _errors_beside_curves(decision: Decision, choice: Sequence[Group]) -> tuple[Decision, HeldOutErrors]:
    """Return the errors of a decision's names beside its curves, and it with the columns that the folds made."""
    equations, errors = held_out_errors(
        decision.equations, decision.named, choice, decision.entry_threshold, decision.unnamed
    )
    return replace(decision, equations=equations), errors


def groups_to_choose_from(decision: Decision, grid: Sequence[Group]) -> list[Group]:
    """Return the groups that each fold chooses from."""
    problem, kept = decision.equations.problem, set(map(id, grid))
    groups = decision.equations.design.groups
    return [group for group in groups if id(group) in kept or _only_proposed(problem, group)]


def _only_proposed(problem: Problem, group: Group) -> bool:
    """Return whether a candidate's shapes come from a residual alone, so that the grid has none of them."""
    return group.candidate is not None and not group.candidate.shapes(problem)
