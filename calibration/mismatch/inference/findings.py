"""What an answer says of a decision: the verdict, each named effect, and what stays unexplained."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import (
    Answer,
    CalibratedParameter,
    Effect,
    FitImprovement,
    Parameter,
    Unexplained,
)
from regolithd.calibration.mismatch.changes import ChangedSize, changes_of
from regolithd.calibration.mismatch.experiments.drives import DIRECTION
from regolithd.calibration.mismatch.inference.evidence import calibrated_values, wheel_names
from regolithd.calibration.mismatch.inference.not_looked_for import not_looked_for
from regolithd.calibration.mismatch.inference.other_answers.alternatives import with_other_statements, with_refused
from regolithd.calibration.mismatch.inference.other_answers.identifiability import indistinguishable
from regolithd.calibration.mismatch.inference.other_answers.other_covariates import (
    notes_on_a_curve_in_place,
    notes_on_other_covariates,
    notes_on_ways_to_act,
)
from regolithd.calibration.mismatch.inference.other_answers.probability import (
    decided_by_evidence,
    is_known,
    other_answers,
    probability,
)
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import information_of, joint_posterior
from regolithd.calibration.mismatch.inference.parameters.own_values import far_enough, notes_on_own_values, own_values
from regolithd.calibration.mismatch.inference.parameters.parameter_information import parameter_covariance
from regolithd.calibration.mismatch.inference.parameters.same_parameters import with_changed_or_moved
from regolithd.calibration.mismatch.inference.statements import notes_on_priors, parameters_found, statement, words_of
from regolithd.calibration.mismatch.inference.uncertainty.intervals import (
    law_stds_of,
    parameters_of,
    size_posteriors_of,
)
from regolithd.calibration.mismatch.inference.uncertainty.sensitivity import sensitivities
from regolithd.calibration.mismatch.inference.unexplained.dynamics import notes_on_dynamics
from regolithd.calibration.mismatch.inference.unexplained.located import share_of_residual, spell_of
from regolithd.calibration.mismatch.inference.unexplained.ranges import notes_on_confined_laws, range_of
from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read
from regolithd.calibration.mismatch.regression.likelihood.lasting_errors import has_lasting_errors
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Change, Indistinguishable, Verdict
    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors
    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.inference.uncertainty.intervals import Drawn
    from regolithd.calibration.mismatch.problem.problem import LeftOut, Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.likelihood.as_read import AsRead
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """What a decision found by itself, as `Answer` has it, without what else could be true.

    `notes` are of what was decided; `notes_on_recording` tell what it was decided from, whatever that was: what is
    wrong with the recording, and what it does not allow to look for.
    """

    verdict: Verdict
    effects: tuple[Effect, ...]
    changes: tuple[Change, ...]
    unexplained: tuple[Unexplained, ...]
    parameters: tuple[CalibratedParameter, ...]
    left_out: tuple[LeftOut, ...]
    notes: tuple[str, ...] = ()
    notes_on_recording: tuple[str, ...] = ()

    @property
    def all_notes(self) -> tuple[str, ...]:
        """Notes of what was decided, then of the recording."""
        return (*self.notes, *self.notes_on_recording, *_not_compared(self.left_out))


def findings_of(
    decision: Decision,
    held_out: HeldOutErrors,
    candidates: Sequence[Candidate],
    applicable: Sequence[Candidate],
    drawn: Drawn | None,
) -> Findings:
    """Return what was found; `applicable` are those candidates that this recording allows, `drawn` is `drawn_for`."""
    problem = decision.equations.problem
    effects, changes = named_effects(decision, held_out, drawn)
    covariance = parameter_covariance(decision, drawn)
    of_wheels = own_values(decision, covariance)
    calibrated = beside_lasting_errors(decision, drawn, calibrated_parameters(decision, covariance))
    parameters = (*calibrated, *far_enough(decision, of_wheels))
    limits, places = decision.equations.thresholds, unexplained(decision)
    rest = bool(decision.unnamed)
    moved = parameters_found(parameters, unexplained=rest, thresholds=limits)
    return Findings(
        verdict=verdict_of(decision, moved),
        effects=effects,
        changes=changes,
        unexplained=places,
        parameters=parameters,
        left_out=problem.left_out,
        notes=(
            *notes_on_priors(parameters, unexplained=rest, thresholds=limits),
            *notes_on_own_values(decision, of_wheels),
            *decision.notes,
            *notes_on_confined_laws(decision, places),
            *notes_on_other_covariates(decision),
            *notes_on_ways_to_act(decision),
            *notes_on_dynamics(decision),
        ),
        notes_on_recording=(
            *problem.recording.notes,
            *_silent_wheels(problem),
            *not_looked_for(problem, candidates, {candidate.name for candidate in applicable}),
        ),
    )


def answer_of(
    decision: Decision,
    held_out: HeldOutErrors,
    candidates: Sequence[Candidate],
    applicable: Sequence[Candidate],
    drawn: Drawn | None,
) -> Answer:
    """Return what was found, and what else could be true."""
    equations, threshold = decision.equations, decision.entry_threshold
    problem, thresholds = equations.problem, equations.thresholds
    found = findings_of(decision, held_out, candidates, applicable, drawn)
    by_evidence = decided_by_evidence(decision)
    others: tuple[Alternative, ...] = ()
    if by_evidence:
        others = with_changed_or_moved(decision, with_other_statements(decision, with_refused(decision)))
    known = by_evidence and is_known(decision, others)
    rest = others if known else ()
    extended, sets = indistinguishable(equations, decision.named, decision.whole, threshold, rest)
    after = held_out.after if decision.named.terms else held_out.before
    return Answer(
        verdict=found.verdict,
        effects=found.effects,
        unexplained=found.unexplained,
        indistinguishable=sets,
        sensitivity=sensitivities(extended, decision.whole, candidates, threshold),
        fit=FitImprovement(problem.simulation.channel, held_out.before, after, noise_floor(decision)),
        parameters=found.parameters,
        changes=found.changes,
        left_out=found.left_out,
        probability=probability(rest, thresholds) if known else None,
        alternatives=other_answers(rest, thresholds),
        notes=(*notes_on_a_curve_in_place(decision, rest), *found.all_notes, *one_way_only(problem, sets)),
    )


def verdict_of(decision: Decision, moved: Sequence[CalibratedParameter]) -> Verdict:
    """Return the verdict: unexplained goes before named; `moved` are parameters that left their priors."""
    if decision.unnamed:
        return "unexplained"
    return "missing-physics" if decision.named.terms or moved else "consistent"


def noise_floor(decision: Decision) -> float:
    """Return the root mean square of what all that was found leaves, over all readings."""
    left = residual_of(decision.equations, decision.whole)
    return float(np.sqrt(np.mean(left[decision.equations.problem.mask] ** 2)))


def named_effects(
    decision: Decision, held_out: HeldOutErrors, drawn: Drawn | None
) -> tuple[tuple[Effect, ...], tuple[Change, ...]]:
    """Return the named effects with parameters and held-out errors, and what changed of corrected ones."""
    named, equations = decision.named, decision.equations
    if drawn is None:
        return (), ()
    parameters, stds = parameters_of(equations, named, drawn), law_stds_of(named, drawn)
    # Beside something unexplained, parameters and sizes imitate a part of it.
    posteriors = size_posteriors_of(equations, named, drawn) if not decision.unnamed else [None] * len(stds)
    effects: list[Effect] = []
    changes: list[Change] = []
    for index, (term, of_term) in enumerate(zip(named.terms, parameters, strict=True)):
        if isinstance(term.group.candidate, ChangedSize):
            wheels = wheel_names(equations.problem, term.wheels)
            changes += changes_of(term.group.candidate, of_term, equations.problem, wheels)
        else:
            errors = held_out.without[index], held_out.with_it[index]
            effect = _effect(equations.problem, term, of_term, errors)
            effects.append(replace(effect, law_std=stds[index], posterior=posteriors[index]))
    return tuple(effects), tuple(changes)


def calibrated_parameters(decision: Decision, covariance: Array) -> tuple[CalibratedParameter, ...]:
    """Return where the recording moved each parameter of the simulation, beside all that was found."""
    equations, fit = decision.equations, decision.whole
    problem, nuisance = equations.problem, equations.nuisance
    values = calibrated_values(equations, fit)
    variances = np.diag(covariance)
    places = {name: place for place, name in enumerate(nuisance.names)}
    found = []
    for name, prior in problem.simulation.parameters.items():
        if not prior.told:
            continue
        std = 0.0
        if name in places:
            place = places[name]
            std = float(np.sqrt(max(variances[place], 0.0)) / equations.design.scale[nuisance.columns[place]])
        value = float(values[name])
        low, high = value - NINETY_PERCENT_STDS * std, value + NINETY_PERCENT_STDS * std
        found.append(CalibratedParameter(name, prior.unit, prior.value, prior.std, value, low, high))
    return tuple(found)


def beside_lasting_errors(
    decision: Decision, drawn: Drawn | None, parameters: tuple[CalibratedParameter, ...]
) -> tuple[CalibratedParameter, ...]:
    """Return parameters as they are; where those that left their priors may have, by errors of inputs that last, held.

    A fit's weights do not know what these errors did to it; its covariance, and what the readings know, do.
    """
    limits, priors = decision.equations.thresholds, decision.equations.problem.simulation.parameters
    beyond = [each for each in parameters if each.beyond_prior(limits)]
    if not beyond or not has_lasting_errors(decision.equations.problem):
        return parameters
    stds = [np.hypot(each.prior_std, (each.high - each.low) / 2 / NINETY_PERCENT_STDS) for each in beyond]
    away = [abs(each.value - each.prior) for each in beyond]
    if any(far > limits.furthest_prior_stds * std for far, std in zip(away, stds, strict=True)):
        return parameters
    return joint_posterior(priors, [information_of(decision, drawn)]).parameters(priors)


def _effect(problem: Problem, term: Term, parameters: Mapping[str, Parameter], errors: tuple[float, float]) -> Effect:
    candidate, simulation = term.group.candidate, problem.simulation
    assert candidate is not None  # noqa: S101  # named terms are candidates
    wheels = wheel_names(problem, term.wheels)
    onset = parameters.get(candidate.change_point)
    words = words_of(candidate, term.group.shape, parameters, problem.labels)
    all_wheels = len(problem.recording.wheels)
    return Effect(
        name=term.name,
        channel=candidate.channel or simulation.channel,
        wheels=wheels,
        covariate=candidate.covariate,
        onset_s=None if onset is None else onset.value,
        equation=candidate.equation,
        statement=statement(
            words, wheels, all_wheels, parameters, errors, simulation.wheel_column, about_mean=problem.arbitrary_zero
        ),
        parameters=parameters,
        rmse_before=errors[0],
        rmse_after=errors[1],
        form=candidate.form_of(term.group.shape),
        shape=term.group.shape,
    )


def unexplained(decision: Decision) -> tuple[Unexplained, ...]:
    """Return where each smooth term acts, from when to when, and how much of the residual it is."""
    if not decision.unnamed:
        return ()
    read = as_read(decision.equations, decision.whole)
    return tuple(_unexplained(decision, read, term) for term in decision.unnamed)


def _unexplained(decision: Decision, read: AsRead, term: Term) -> Unexplained:
    equations, problem = decision.equations, decision.equations.problem
    spells = next((each for each in decision.intermittent if each.term is term), None)
    first_s, last_s = (spells.from_s, spells.to_s) if spells else spell_of(equations, read, term)
    return Unexplained(
        channel=problem.simulation.channel,
        wheels=wheel_names(problem, term.wheels),
        covariate=term.name,
        from_s=first_s,
        to_s=last_s,
        share_of_residual=spells.share_of_residual if spells else share_of_residual(equations, read, term),
        range=range_of(decision, term),
        period=term.group.period,
    )


def _silent_wheels(problem: Problem) -> list[str]:
    """Return a note of the wheels at which nothing is compared."""
    kind = problem.simulation.wheel_column
    silent = [name for k, name in enumerate(problem.recording.wheels) if not problem.mask[:, k].any()]
    if not silent:
        return []
    return [f"There is nothing to compare at {kind} {', '.join(map(str, silent))}: it never turns, or is not measured."]


def _not_compared(left_out: Sequence[LeftOut]) -> list[str]:
    """Return notes of the readings that were left out of the comparison, and why."""
    return [f"Readings of {each.channel} that are not compared: {each.readings} ({each.reason})." for each in left_out]


def one_way_only(problem: Problem, sets: Sequence[Indistinguishable]) -> list[str]:
    """Return a note where an experiment asks for a reversal, and the recording has none."""
    if problem.simulation.one_way is not None or not any(DIRECTION in one.vary for one in sets):
        return []
    ways = np.unique(problem.covariates[DIRECTION][problem.mask])
    if {-1.0, 1.0} <= set(ways.tolist()):
        return []
    return ["The motion is one way only: state in one_way whether the machine can reverse, as an experiment asks for."]
