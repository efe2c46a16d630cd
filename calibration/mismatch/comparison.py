"""The whole comparison: a recording and a simulation in, an answer and its evidence out.

recording, simulation ─▶ problem ─▶ design matrix ─▶ decision ─▶ answer, evidence
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Answer, FitImprovement
from regolithd.calibration.mismatch.calibration import bent, linearised_where_it_fits, moved_values
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import change_in_words, corrected_problem, stated_in, with_changes
from regolithd.calibration.mismatch.findings import (
    beyond_prior,
    calibrated_parameters,
    named_effects,
    noise_floor,
    unexplained,
    verdict_of,
)
from regolithd.calibration.mismatch.inference.evidence import evidence_of
from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors, held_out_errors
from regolithd.calibration.mismatch.inference.identifiability import indistinguishable
from regolithd.calibration.mismatch.inference.sensitivity import sensitivities
from regolithd.calibration.mismatch.inference.several_channels import merged_answers
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time, folds_of_blocks
from regolithd.calibration.mismatch.regression.candidate_groups import with_candidates
from regolithd.calibration.mismatch.regression.design_matrix import empty_design
from regolithd.calibration.mismatch.regression.normal_equations import normal_equations
from regolithd.calibration.mismatch.regression.nuisance import with_nuisance
from regolithd.calibration.mismatch.regression.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.selection.decision import decide, without_name
from regolithd.calibration.mismatch.signal.noise import estimate_noise
from regolithd.calibration.mismatch.simulation.one_channel import OneChannel
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.calibration.mismatch.answer import CalibratedParameter, Contribution, Evidence
    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Group
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


SEARCHES = 2
"""Searches at most (a choice): the second where the effects that were found move the parameters far."""


@dataclass(frozen=True)
class Comparison:
    """The answer, and the arrays behind it."""

    answer: Answer
    evidence: Evidence


def compare(
    recording: Recording,
    simulation: Simulation,
    *,
    effects: Sequence[Contribution] = (),
    thresholds: Thresholds = THRESHOLDS,
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Find where a simulation and a recording differ, and what physics was left out.

    Parameters
    ----------
    effects: those that the simulation has already (from an earlier `--corrected`)
    thresholds: the numbers that decide, for studies of them
    progress: called with the name of each stage

    Raises
    ------
    MismatchError
        When there is nothing to compare.
    """
    if simulation.channels:
        found = [
            _labelled(
                compare(
                    recording,
                    OneChannel(simulation, channel),
                    effects=[e for e in effects if e.channel == channel],
                    thresholds=thresholds,
                    progress=progress,
                ),
                channel,
            )
            for channel in simulation.channels
        ]
        return merged(found)
    progress("simulating")
    candidates: Sequence[Candidate] = [each.form_for(simulation) for each in simulation.candidates(library())]
    stated = stated_in(candidates, effects, simulation.stated_effects())

    def pose(values: Mapping[str, float] | None) -> Problem:
        return corrected_problem(build_problem(recording, simulation, values, thresholds=thresholds), stated)

    problem = linearised_where_it_fits(pose)
    candidates = with_changes(problem, candidates, stated)
    for _ in range(SEARCHES):
        progress("computing the columns of all candidates")
        equations, applicable = equations_of(problem, candidates)
        progress("searching")
        decision = decide(equations, applicable)
        values = moved_values(decision.equations, decision.whole)
        if not bent(problem, values):
            break
        problem = pose(values)
    progress("measuring on held-out blocks and comparing with rivals")
    decision, held_out = earned(decision, equations.design.groups)
    answer = _answer(decision, held_out, candidates, applicable)
    evidence = replace(
        evidence_of(decision),
        candidates=tuple(candidates),
        covariate_labels=simulation.covariate_labels,
        wheel_column=simulation.wheel_column,
    )
    return Comparison(answer, evidence)


def _labelled(comparison: Comparison, channel: str) -> Comparison:
    """Return a comparison whose terms say which channel they are of."""
    terms = tuple(replace(term, channel=channel) for term in comparison.evidence.contributions)
    return replace(comparison, evidence=replace(comparison.evidence, contributions=terms))


def merged(comparisons: Sequence[Comparison]) -> Comparison:
    """Return one comparison of several channels: every finding, and the pictures of the channel with most of them."""
    answer = merged_answers([each.answer for each in comparisons])
    shown = max(comparisons, key=lambda each: len(each.answer.effects) + len(each.answer.unexplained))
    terms = tuple(term for each in comparisons for term in each.evidence.contributions)
    values = {parameter.name: parameter.value for parameter in answer.parameters}
    return Comparison(answer, replace(shown.evidence, contributions=terms, values=values))


def equations_of(problem: Problem, candidates: Sequence[Candidate]) -> tuple[NormalEquations, tuple[Candidate, ...]]:
    """Return the normal equations of free parameters, candidates and smooth terms, and the applicable candidates.

    The weights are those of the whole residual; the decision estimates better ones.
    """
    residual = np.where(problem.mask, problem.measured - problem.filled, 0.0)
    noise = estimate_noise(residual, problem.mask, problem.thresholds)
    blocks = blocks_of_time(problem, noise)
    design, nuisance = with_nuisance(empty_design(problem, folds_of_blocks(problem, blocks)))
    design, applicable = with_candidates(design, candidates)
    return normal_equations(with_smooth_terms(design), nuisance, noise.weights), applicable


def earned(decision: Decision, grid: Sequence[Group]) -> tuple[Decision, HeldOutErrors]:
    """Return the decision without names that lower no held-out error, the worst dropped first; and those errors.

    `grid` are the groups before any data optimised their shapes.
    """
    equations, threshold = decision.equations, decision.entry_threshold
    problem, kept = equations.problem, set(map(id, grid))
    choice = [group for group in equations.design.groups if id(group) in kept or _only_proposed(problem, group)]
    held_out = held_out_errors(equations, decision.named, choice, threshold)
    while (idle := held_out.without_gain()) is not None:
        decision = without_name(decision, idle)
        held_out = held_out_errors(equations, decision.named, choice, threshold)
    return decision, held_out


def _answer(
    decision: Decision, held_out: HeldOutErrors, candidates: Sequence[Candidate], applicable: Sequence[Candidate]
) -> Answer:
    """Return the answer."""
    equations, threshold = decision.equations, decision.entry_threshold
    problem, named = equations.problem, decision.named
    effects, changes = named_effects(decision, held_out)
    parameters = calibrated_parameters(decision)
    moved = beyond_prior(parameters, equations.thresholds)
    extended, sets = indistinguishable(equations, decision.named, decision.whole, threshold)
    channel, floor = problem.simulation.channel, noise_floor(decision)
    return Answer(
        verdict=verdict_of(decision, moved),
        effects=effects,
        unexplained=tuple(unexplained(decision, term) for term in decision.unnamed),
        indistinguishable=sets,
        sensitivity=sensitivities(extended, decision.whole, candidates, threshold),
        fit=FitImprovement(channel, held_out.before, held_out.after if named.terms else held_out.before, floor),
        parameters=parameters,
        changes=changes,
        left_out=problem.left_out,
        notes=(
            *map(_beyond_prior_in_words, moved),
            *map(change_in_words, changes),
            *problem.recording.notes,
            *_about_the_mask(problem),
            *_not_looked_for(problem, candidates, [candidate.name for candidate in applicable]),
        ),
    )


def _only_proposed(problem: Problem, group: Group) -> bool:
    """Return whether a candidate's shapes come from a residual alone, so that the grid has none of them."""
    return group.candidate is not None and not group.candidate.shapes(problem)


def _about_the_mask(problem: Problem) -> list[str]:
    """Return notes of what was left out of the comparison, and why."""
    notes = []
    kind = problem.simulation.wheel_column
    silent = [name for k, name in enumerate(problem.recording.wheels) if not problem.mask[:, k].any()]
    if silent:
        notes.append(
            f"There is nothing to compare at {kind} {', '.join(map(str, silent))}: it never turns, or is not measured."
        )
    notes += [
        f"Readings of {each.channel} that are not compared: {each.readings} ({each.reason})."
        for each in problem.left_out
    ]
    return notes


def _beyond_prior_in_words(parameter: CalibratedParameter) -> str:
    away = abs(parameter.value - parameter.prior) / parameter.prior_std
    return (
        f"{parameter.name} had to leave its prior: {parameter.value:.4g} {parameter.unit}, "
        f"{away:.1f} standard deviations from {parameter.prior:.4g}. Check the stated value and its standard deviation."
    )


def _not_looked_for(problem: Problem, candidates: Sequence[Candidate], applicable: Sequence[str]) -> list[str]:
    """Return a note of the candidates that this recording or simulation does not allow, by what they lack."""
    lacking: dict[str, list[str]] = {}
    for candidate in candidates:
        if candidate.name not in applicable:
            needs = ", ".join(name for name in candidate.requires if name not in problem.covariates)
            lacking.setdefault(needs or "another kind of machine", []).append(candidate.name)
    if not lacking:
        return []
    return [
        "Not looked for: " + "; ".join(f"{', '.join(names)} (needs {needs})" for needs, names in lacking.items()) + "."
    ]
