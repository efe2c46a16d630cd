"""Identifiability: which other effects would explain the recording as well as those that were named."""

from __future__ import annotations

from math import erfc, sqrt
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.experiments.choice import experimenter_of
from regolithd.calibration.mismatch.inference.other_answers.collinearity import collinear_sets, parameters_like
from regolithd.calibration.mismatch.inference.other_answers.experiment import Addition, with_experiment
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import implausibility, with_candidate
from regolithd.calibration.mismatch.regression.residuals import relative_size
from regolithd.calibration.mismatch.selection.best_subsets import (
    acceptable,
    best_of_each_candidate,
    optimised_shapes,
    physically_plausible,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from regolithd.calibration.mismatch.answer import Indistinguishable
    from regolithd.calibration.mismatch.experiments.choice import Experimenter
    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.regression.group import Fit, Group
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def indistinguishable(
    equations: NormalEquations, named: Fit, whole: Fit, entry_threshold: float, others: Sequence[Alternative] = ()
) -> tuple[NormalEquations, tuple[Indistinguishable, ...]]:
    """Return what could stand for the named effects, and what could not be told apart were it there.

    Shapes of rivals are optimised: the equations that come back have their columns. The experiments tell `others`,
    the most probable other answers, apart as well.
    """
    experimenter = experimenter_of(equations, entry_threshold)
    equations, found = rivals(equations, named, experimenter, others)
    taken = frozenset(name for one in found for name in one.effects)
    return equations, (*found, *collinear_sets(equations, whole, experimenter.on(equations), others, taken))


def rivals(
    equations: NormalEquations, named: Fit, experimenter: Experimenter, others: Sequence[Alternative] = ()
) -> tuple[NormalEquations, tuple[Indistinguishable, ...]]:
    """Return, for each named effect that has rivals, the set of effects that explain the recording as well."""
    found = []
    for index in range(len(named.terms)):
        rest = named.without(index)
        equations, members = _in_its_place(equations, named, index)
        taken = {member.name for member in (*named.terms, *members)}
        equations, additions = _takes_over(equations, named, index)
        beside = [addition for addition in additions if addition.more.name not in taken]
        names = (*(member.name for member in members), *parameters_like(equations, rest, members))
        if len(names) + len(beside) > 1:
            found.append(with_experiment(names, experimenter.on(equations), rest, members, others, beside))
    return equations, tuple(found)


def _in_its_place(equations: NormalEquations, named: Fit, index: int) -> tuple[NormalEquations, list[Term]]:
    """Return a named effect and those that could be true in its place."""
    term, others = named.terms[index], named.without(index)
    members = [term]
    for _, rival in best_of_each_candidate(equations, others)[: equations.thresholds.rivals_tried]:
        if rival.name == term.name:
            continue
        equations, terms = optimised_shapes(equations, (*others, rival))
        fit = equations.fit(terms)
        if acceptable(equations, fit) and _could_be_true(equations, named, fit, index):
            members.append(rival)
    known = {member.name for member in members}
    return equations, [*members, *_as_without_its_covariate(equations, named, index, known)]


def _as_without_its_covariate(
    equations: NormalEquations, named: Fit, index: int, known: Collection[str]
) -> Iterator[Term]:
    """Yield laws that explain as much as a named effect because their covariate hardly varied here.

    They are not named, since they gain nothing by it: the same drag at any temperature, say. Nothing speaks against
    them either. What their many shapes cost is no evidence, so that Δχ² is compared.
    """
    term, others = named.terms[index], named.without(index)
    best: dict[str, tuple[float, Term]] = {}
    groups = [group for group in equations.design.groups if group.name not in known and _has_law_without(group)]
    for gain, rival in equations.further(others, groups):
        if rival.wheels == term.wheels and gain > best.get(rival.name, (0.0, term))[0]:
            best[rival.name] = gain, rival
    for _, rival in best.values():
        fit = equations.fit((*others, rival))
        place = len(fit.terms) - 1
        large = relative_size(equations, fit, place) >= equations.thresholds.smallest_effect
        if large and physically_plausible(equations, fit, place) and _gains_as_much(equations, named, fit, index):
            yield rival


def _has_law_without(group: Group) -> bool:
    return group.candidate is not None and group.candidate.without_covariate(group.shape) is not None


def _gains_as_much(equations: NormalEquations, named: Fit, rival: Fit, index: int) -> bool:
    """Return whether the rival, were it true, would gain this much less than the named effect often enough."""
    limits, apart = equations.thresholds, _energy_beside(equations, named, rival, index)
    behind = max(named.delta_chi2 - rival.delta_chi2, 0.0)
    return apart <= 1e-9 or wrong_choice_rate(behind, apart) > limits.confusion_rate


def _takes_over(equations: NormalEquations, named: Fit, index: int) -> tuple[NormalEquations, list[Addition]]:
    """Return the effects that may be there as well: beside them the named one is smaller, and the fit as good.

    A law with a free shape can stand for two: drag that falls with temperature holds a drag that does not. Beside the
    other effect it may have another shape, from which no gain leads to the one that was fitted: each of the grid's
    values is tried too.
    """
    limits, others = equations.thresholds, named.without(index)
    before, best = relative_size(equations, named, index), dict[str, tuple[float, Addition]]()
    equations, laws = _of_other_values(equations, named.terms[index])
    for law in (named.terms[index], *laws):
        scored = best_of_each_candidate(equations, (*others, law))
        likely = [more for _, more in scored if more.group.own_channel is None]
        for more in likely[: limits.additions_tried]:
            terms: tuple[Term, ...] = (*others, law, more)
            if law is named.terms[index]:
                equations, terms = optimised_shapes(equations, terms)
            fit = equations.fit(terms)
            score = equations.score(fit)
            if not acceptable(equations, fit) or score < equations.score(named) - limits.lead_margin:
                continue
            left, taken = (relative_size(equations, fit, place) for place in (len(others), len(others) + 1))
            least = limits.taken_over_share * before
            if before - left > least and taken > least and score > best.get(more.name, (-float("inf"),))[0]:
                best[more.name] = score, Addition(*fit.terms[-2:])
    return equations, [addition for _, addition in best.values()]


def _of_other_values(equations: NormalEquations, term: Term) -> tuple[NormalEquations, list[Term]]:
    """Return a law with one of its free parameters at another of the grid's values, and equations with the columns.

    Not of an onset, which other effects do not take over, nor of a law that states its coefficient.
    """
    candidate, now = term.group.candidate, term.group.shape
    if candidate is None or candidate.stated_coefficient(now) is not None:
        return equations, []
    free = [name for name in candidate.free if name in now and name != candidate.change_point]
    grid = [shape for shape in candidate.shapes(equations.problem) if free and shape.keys() == now.keys()]
    tried = [{**now, name: value} for name in free for value in {shape[name]: None for shape in grid}]
    there = [group for group in equations.design.groups if group.law == term.group.law and group.shape in tried]
    known = [now, *(group.shape for group in there)]
    design, new = with_candidate(equations.design, candidate, [shape for shape in tried if shape not in known])
    return equations.over(design), [Term(group, term.wheels) for group in (*there, *new) if group.shape != now]


def _could_be_true(equations: NormalEquations, named: Fit, rival: Fit, index: int) -> bool:
    """Return whether the rival, were it true, would trail the named effect by this much often enough."""
    limits, own = equations.thresholds, rival.terms[-1]
    candidate = own.group.candidate
    # What speaks against a rival beforehand is not what the recording says against it.
    beforehand = implausibility(equations.problem, candidate, own.group.shape) if candidate else 0.0
    lead = max(equations.score(named) - equations.score(rival) - beforehand - limits.lead_margin, 0.0)
    apart = _energy_beside(equations, named, rival, index)
    if apart <= 1e-9 or named.delta_chi2 - rival.delta_chi2 < limits.equal_gain:
        return True
    return wrong_choice_rate(lead, apart) > limits.confusion_rate


def _energy_beside(equations: NormalEquations, named: Fit, rival: Fit, index: int) -> float:
    """Return the energy of a rival's last term outside the span of the named effect and all else."""
    _, complement = equations.own_and_complement((*named.without(index), named.terms[index]), rival.terms[-1])
    values = rival.coefficients[rival.of_term(len(rival.terms) - 1)]
    return float(values @ complement @ values)


def wrong_choice_rate(lead: float, apart: float) -> float:
    """Return how often the wrong one of two effects leads by at least `lead`.

    The true one's lead is normal about μ with variance 4 μ, where μ is the energy of its term, `apart`, outside the
    span of the other.
    """
    return 0.5 * erfc((lead + apart) / (2 * sqrt(2 * apart)))
