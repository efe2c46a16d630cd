"""Changes of corrected effects that a parameter takes up, against the parameters as they were when these were found.

A drag that has grown passes for a coefficient of the load that is larger, as long as both are within their own standard
deviations. The recording in which the drag was found knows their sum better than either (`SizePosterior`). Three
explanations of a later recording are weighed, each by its least χ² of readings and priors:

same: parameters and size are what that recording has them to be, together;
changed: the parameters are, and the size is any;
moved: the size is as corrected, and the parameters are anywhere within their stated priors.

Where `same` is refuted, something has changed since: the effect's size, if `changed` is not behind `moved` and the size
that it has is another one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.changes import ChangedSize
from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
from regolithd.calibration.mismatch.inference.parameters.parameter_information import SINGULAR
from regolithd.calibration.mismatch.inference.statements import after_number, listed
from regolithd.calibration.mismatch.regression.nuisance import EXACT, stated_names
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse
from regolithd.calibration.mismatch.selection.decision import answer_names
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Group, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

TOLD_SHARE = 0.5
"""Share of the furthest move, in standard deviations of what was known, beyond which another is told too (a choice)."""

CERTAIN_LEAD = 9.2
"""Lead in Δχ² from which on the readings tell an effect's change from a parameter's: 2 ln 99, odds of 99 to 1."""


@dataclass(frozen=True, eq=False)
class _Weighed:
    """A corrected effect beside parameters as they were: three least χ², and where `moved` has the parameters.

    Attributes
    ----------
    change: the change's groups
    places: of the parameters among the nuisance parameters, and of the size, which is last
    mean, covariance: of parameters and size from where the problem is linearised, as they were
    refuted: χ² of `same` above that of `changed`
    lead: χ² of `moved` above that of `changed`
    differs: whether the 90 % interval of the size that `changed` has is without the one that was corrected
    moved: where `moved` has the parameters, from where the problem is linearised
    """

    change: tuple[Group, ...]
    places: tuple[int, ...]
    mean: Array
    covariance: Array
    refuted: float
    lead: float
    differs: bool
    moved: Array

    @property
    def says_changed(self) -> bool:
        """Whether the effect's size is what has changed, if something has."""
        return self.differs and self.lead > 0


def with_changes_beside_same_parameters(decision: Decision) -> Decision:
    """Return the decision with changes of corrected effects for which the parameters were told to move.

    The one for which most speaks comes first. Beside something unexplained parameters imitate a part of that, so that
    nothing is weighed. A change that was told already, beside parameters anywhere within their priors, is weighed again
    where these might have moved instead: its size is better known beside parameters as they were.
    """
    changes = [] if decision.unnamed else [term for term in decision.whole.terms if _place(term.group) is not None]
    for term in changes:
        rest = _without(decision, term)
        told = [each for each in _weighed(rest) if _place(each.change[0]) == _place(term.group)]
        if told and _is_refuted(rest, told[0]) and told[0].says_changed and told[0].lead < CERTAIN_LEAD:
            decision = _with_change(rest, told[0])
    for _ in decision.equations.problem.stated:
        found = [] if decision.unnamed else list(_weighed(decision))
        told = [each for each in found if _is_refuted(decision, each) and each.says_changed]
        if not told:
            return _with_notes_on_rivals(decision, found)
        decision = _with_change(decision, max(told, key=lambda each: each.refuted))
    return decision


def with_changed_or_moved(decision: Decision, others: tuple[Alternative, ...]) -> tuple[Alternative, ...]:
    """Return the other answers, with that in which a parameter moved instead of an effect's size, or the reverse."""
    if not decision.changed_or_moved:
        return others
    name, lead = min(decision.changed_or_moved.items(), key=lambda item: abs(item[1]))
    kept = [term for term in decision.whole.terms if not (term.group.is_change and term.name == name)]
    told = len(kept) < len(decision.whole.terms)
    names = answer_names(kept) if told else answer_names(kept) | {name}
    other = Alternative(tuple(sorted(names)), max(lead if told else -lead, 0.0), tuple(kept))
    rest = [each for each in others if each.effects != other.effects]
    return tuple(sorted((other, *rest), key=lambda each: each.margin))


def _without(decision: Decision, term: Term) -> Decision:
    """Return the decision without one of its terms."""
    fits = (decision.named, decision.whole)
    named, whole = (decision.equations.fit([each for each in fit.terms if each is not term]) for fit in fits)
    return replace(decision, named=named, whole=whole)


def _weighed(decision: Decision) -> Iterator[_Weighed]:
    """Yield each corrected effect that has a posterior and was not found to have changed."""
    equations = decision.equations
    changed = {_place(term.group) for term in decision.whole.terms}
    for place, effect in enumerate(equations.problem.stated):
        change = tuple(group for group in equations.design.groups if _place(group) == place)
        if place not in changed and change and effect.posterior is not None:
            weighed = _weigh(equations, decision.whole.terms, place, change)
            if weighed is not None and not _leaves_its_prior(decision, weighed):
                yield weighed


def _place(group: Group) -> int | None:
    """Return the place of the corrected effect that a group is a change of; None where it is none."""
    return group.candidate.place if isinstance(group.candidate, ChangedSize) else None


def _weigh(
    equations: NormalEquations, terms: tuple[Term, ...], place: int, change: tuple[Group, ...]
) -> _Weighed | None:
    """Return how the three explanations of the effect in one place compare beside all that was found."""
    problem, nuisance, effect = equations.problem, equations.nuisance, equations.problem.stated[place]
    posterior, size = effect.posterior, stated_names(problem)[place]
    assert posterior is not None  # noqa: S101  # only such effects come here
    kept = [k for k, name in enumerate(posterior.parameters) if name in nuisance.names and _acts(problem, name)]
    if not kept or size not in nuisance.names:
        return None
    names = [posterior.parameters[k] for k in kept]
    covariance = posterior.matrix[np.ix_([*kept, -1], [*kept, -1])]
    # Another recording has a discrepancy of the law of its own.
    covariance[-1, -1] = max(covariance[-1, -1], effect.relative_std**2)
    at = np.array([problem.values[name] for name in names])
    priors = [problem.simulation.parameters[name] for name in names]
    mean = np.array([*(posterior.values[k] for k in kept), 0.0]) - [*at, 0.0]
    stated = np.array([*(prior.value for prior in priors), 0.0]) - [*at, 0.0]
    of_parameters = pseudo_inverse(covariance[:-1, :-1], SINGULAR)
    within = np.diag([*(prior.std**-2.0 for prior in priors), effect.relative_std**-2.0])

    places = tuple(nuisance.names.index(name) for name in [*names, size])
    matrix, vector = equations.information(terms, places)
    scale = equations.design.scale[[nuisance.columns[place] for place in places]]
    readings = _Readings(matrix * np.outer(scale, scale), vector * scale)
    same, _, _ = readings.least(pseudo_inverse(covariance, SINGULAR), mean)
    changed, now, spread = readings.least(np.pad(of_parameters, (0, 1)), mean)
    moved, there, _ = readings.least(within, stated)
    differs = bool(abs(now[-1]) > NINETY_PERCENT_STDS * np.sqrt(spread[-1, -1]))
    return _Weighed(change, places, mean, covariance, same - changed, moved - changed, differs, there)


def _acts(problem: Problem, parameter: str) -> bool:
    """Return whether the predicted channel depends on a parameter: others of a simulation are of other channels."""
    return bool(problem.tangent(parameter)[problem.mask].any())


@dataclass(frozen=True, eq=False)
class _Readings:
    """What the readings say of parameters and size: their χ² is xᵀ M x − 2 vᵀ x, but for a constant."""

    matrix: Array
    vector: Array

    def least(self, precision: Array, mean: Array) -> tuple[float, Array, Array]:
        """Return the least χ² of readings and a prior, where it is, and the covariance there."""
        vector = self.vector + precision @ mean
        covariance = pseudo_inverse(self.matrix + precision, SINGULAR)
        x = covariance @ vector
        return float(mean @ precision @ mean - vector @ x), x, covariance


def _leaves_its_prior(decision: Decision, weighed: _Weighed) -> bool:
    """Return whether a parameter would be beyond its prior beside the effect as corrected: that is a finding itself."""
    problem, names = decision.equations.problem, decision.equations.nuisance.names
    for shift, place in zip(weighed.moved[:-1].tolist(), weighed.places[:-1], strict=True):
        prior = problem.simulation.parameters[names[place]]
        away = abs(problem.values[names[place]] + shift - prior.value) / prior.std
        if away > problem.thresholds.furthest_prior_stds:
            return True
    return False


def _is_refuted(decision: Decision, weighed: _Weighed) -> bool:
    """Return whether parameters and size cannot be what they were: by what a change must gain to be told."""
    limits, group = decision.equations.thresholds, weighed.change[0]
    return weighed.refuted > decision.entry_threshold + limits.coefficient_penalty + group.selection_penalty


def _with_change(decision: Decision, weighed: _Weighed) -> Decision:
    """Return the decision with the change, its parameters as they were, and a note on what else could be."""
    equations = decision.equations
    nuisance, scale = equations.nuisance, equations.design.scale
    precision, centre = nuisance.precision.copy(), nuisance.centre.copy()
    of_column = scale[[nuisance.columns[place] for place in weighed.places]]
    on = list(weighed.places)
    precision[on] = 1 / (np.diag(weighed.covariance) * of_column**2)
    centre[on] = weighed.mean * of_column
    as_was = replace(nuisance, precision=precision, centre=centre).with_precision(on[-1], EXACT)
    kept = equations.with_nuisance(as_was)
    best = kept.gains(decision.named.terms, weighed.change).largest_score()
    if best is None:
        return decision
    name = best[1].name
    note = (
        f"{name} is told to have changed, with the parameters as they were when it was found. If they may differ "
        f"between the two recordings, {_moved_in_words(decision, weighed)} may explain this one in its place."
    )
    return replace(
        decision,
        equations=kept,
        named=kept.fit((*decision.named.terms, best[1])),
        whole=kept.fit((*decision.whole.terms, best[1])),
        changed_or_moved={**decision.changed_or_moved, name: weighed.lead},
        notes=(*decision.notes, note),
    )


def _with_notes_on_rivals(decision: Decision, found: list[_Weighed]) -> Decision:
    """Return the decision with a note on each effect that may have changed, where a parameter may have as well."""
    close = [
        each for each in found if _is_refuted(decision, each) and each.lead > -decision.equations.thresholds.lead_margin
    ]
    notes = [
        f"Since {each.change[0].name} was found, something has changed: {_moved_in_words(decision, each)}, or the size "
        "of the effect. This recording does not tell which."
        for each in close
    ]
    leads = {each.change[0].name: each.lead for each in close}
    return replace(decision, changed_or_moved={**decision.changed_or_moved, **leads}, notes=(*decision.notes, *notes))


def _moved_in_words(decision: Decision, weighed: _Weighed) -> str:
    """Return where `moved` has the parameters that go furthest from where they were, beside a size as it has it."""
    problem, nuisance, covariance = decision.equations.problem, decision.equations.nuisance, weighed.covariance
    follows = covariance[:-1, -1] / covariance[-1, -1]
    was = weighed.mean[:-1] + follows * (weighed.moved[-1] - weighed.mean[-1])
    stds = np.sqrt(np.maximum(np.diag(covariance)[:-1] - follows * covariance[:-1, -1], 1e-300))
    away = np.abs(weighed.moved[:-1] - was) / stds
    told: list[str] = []
    for k in np.argsort(-away):
        name = nuisance.names[weighed.places[k]]
        prior, at = problem.simulation.parameters[name], problem.values[name]
        if away[k] > TOLD_SHARE * away.max():
            told.append(f"{name} = {at + weighed.moved[k]:.4g}{after_number(prior.unit)} instead of {at + was[k]:.4g}")
    return listed(told)
