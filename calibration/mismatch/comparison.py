"""The whole comparison: a recording and a simulation in, an answer and its evidence out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import (
    Answer,
    Contribution,
    Curve,
    Effect,
    Evidence,
    FitImprovement,
    Parameter,
    Unexplained,
    Verdict,
)
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.corrected import effect_of
from regolithd.calibration.mismatch.inference.held_out import HeldOut, hold_out
from regolithd.calibration.mismatch.inference.identifiability import confusions
from regolithd.calibration.mismatch.inference.intervals import parameters_of
from regolithd.calibration.mismatch.inference.sensitivity import sensitivities
from regolithd.calibration.mismatch.problem.problem import Problem, build_problem
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time, folds_of_blocks
from regolithd.calibration.mismatch.regression.design_matrix import Dictionary, Group
from regolithd.calibration.mismatch.regression.normal_equations import (
    NOT_FOR_CURVES,
    add_candidates,
    add_curves,
    add_nuisance,
)
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.report.statements import statement
from regolithd.calibration.mismatch.selection.decision import Decision, decide
from regolithd.calibration.mismatch.selection.subset_selection import Search, Term
from regolithd.calibration.mismatch.signal.noise import Noise, estimate_noise

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """What the tool says, and what it has seen."""

    answer: Answer
    evidence: Evidence


def compare(
    recording: Recording,
    simulation: Simulation,
    *,
    effects: Sequence[Contribution] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Find where a simulation and a recording differ, and what physics was left out.

    `effects` are those that the simulation has already (from an earlier `--corrected`).

    Raises
    ------
    MismatchError
        When there is nothing to compare.
    """
    progress("simulating")
    problem = build_problem(recording, simulation)
    candidates = simulation.candidates(library())
    if effects:
        problem = replace(problem, prediction=problem.prediction + effect_of(problem, candidates, effects))
    noise = estimate_noise(np.where(problem.mask, problem.measured - problem.filled, 0.0), problem.mask)
    blocks = blocks_of_time(problem, noise)
    dictionary = Dictionary(problem, folds_of_blocks(problem, blocks))
    nuisance = add_nuisance(dictionary)
    progress("building what could be missing")
    fitting = add_candidates(dictionary, candidates)
    add_curves(dictionary)
    grid = tuple(dictionary.groups)
    progress("searching")
    decision = decide(Search(dictionary, nuisance, noise.weights), fitting)
    blocks = blocks_of_time(problem, decision.noise)
    progress("measuring on held-out blocks")
    sought = [g for g in dictionary.groups if g in grid or _only_proposed(problem, g)]
    held = hold_out(decision.search, decision.named, decision.noise, sought)
    progress("weighing rivals")
    answer = Answer(
        _verdict(decision),
        _effects(decision, held, blocks),
        tuple(_unexplained(decision, term) for term in decision.unnamed),
        confusions(decision.search, decision.named, decision.whole),
        sensitivities(decision.search, decision.whole, candidates),
        FitImprovement(simulation.channel, held.before, held.after, _floor(decision)),
        (
            *problem.recording.notes,
            *_about_the_mask(problem),
            *_not_looked_for(problem, candidates, [c.name for c in fitting]),
        ),
    )
    evidence = replace(
        _evidence(decision),
        candidates=tuple(candidates),
        covariate_labels=simulation.covariate_labels,
        wheel_column=simulation.wheel_column,
    )
    return Comparison(answer, evidence)


def _only_proposed(problem: Problem, group: Group) -> bool:
    """Return whether a candidate's shapes come from a residual alone, so that the grid has none of them."""
    return group.candidate is not None and not group.candidate.shapes(problem)


def _verdict(decision: Decision) -> Verdict:
    if decision.unnamed:
        return "unexplained"
    return "missing-physics" if decision.named.terms else "consistent"


def _floor(decision: Decision) -> float:
    """Return the noise's root mean square over all values."""
    counts = decision.search.dictionary.counts.sum(axis=0)
    return float(np.sqrt(np.sum(decision.noise.deviation**2 * counts) / counts.sum()))


def _names(problem: Problem, wheels: Sequence[int]) -> tuple[int, ...]:
    """Return the names of those wheels of which something is known."""
    return tuple(problem.recording.wheels[w] for w in wheels if problem.mask[:, w].any())


def _effects(decision: Decision, held: HeldOut, blocks: NDArray[np.int64]) -> tuple[Effect, ...]:
    search, named = decision.search, decision.named
    if not named.terms:
        return ()
    problem = search.dictionary.problem
    found = []
    for index, (term, parameters) in enumerate(zip(named.terms, parameters_of(search, named, blocks), strict=True)):
        candidate = term.group.candidate
        assert candidate is not None  # noqa: S101  # named terms are candidates
        wheels = _names(problem, term.wheels)
        onset = parameters.get("onset_s")
        errors = (held.without[index], held.with_it[index])
        told = statement(
            candidate, wheels, len(problem.recording.wheels), parameters, errors, problem.simulation.wheel_column
        )
        found.append(
            Effect(
                term.name,
                candidate.channel or problem.simulation.channel,
                wheels,
                candidate.covariate,
                onset.value if isinstance(onset, Parameter) else None,
                candidate.equation,
                told,
                parameters,
                *errors,
            )
        )
    return tuple(found)


def _unexplained(decision: Decision, term: Term) -> Unexplained:
    """Say where a curve without a name lives, from when to when, and how much of the residual it is."""
    search, problem = decision.search, decision.search.dictionary.problem
    index = decision.whole.terms.index(term)
    values = contribution(search, decision.whole, index)
    before = residual_of(search, search.fit(()))
    on = list(term.wheels)
    share = float(np.sum(values[:, on] ** 2) / max(float(np.sum(before[:, on] ** 2)), 1e-300))
    size = np.sum(values[:, on] ** 2, axis=1)
    grown = np.cumsum(size) / max(float(size.sum()), 1e-300)
    time_s = problem.time_s[:, 0]
    first, last = (time_s[min(int(np.searchsorted(grown, part)), len(time_s) - 1)] for part in (0.01, 0.99))
    return Unexplained(
        problem.simulation.channel, _names(problem, term.wheels), term.name, float(first), float(last), min(share, 1.0)
    )


def _about_the_mask(problem: Problem) -> list[str]:
    """Say what was left out of the comparison, and why."""
    told = []
    kind = problem.simulation.wheel_column
    silent = [name for k, name in enumerate(problem.recording.wheels) if not problem.mask[:, k].any()]
    if silent:
        told.append(
            f"There is nothing to compare at {kind} {', '.join(map(str, silent))}: it never turns, or is not measured."
        )
    spikes = int(np.sum(np.isfinite(problem.prediction) & np.isfinite(problem.measured) & ~problem.mask))
    if spikes:
        told.append(f"{spikes} readings of {problem.simulation.channel} are far outside all others; they are left out.")
    return told


def _not_looked_for(problem: Problem, candidates: Sequence[Candidate], fitting: Sequence[str]) -> list[str]:
    told = []
    for candidate in candidates:
        if candidate.name not in fitting:
            lacking = ", ".join(n for n in candidate.requires if n not in problem.covariates)
            told.append(f"{candidate.name} was not looked for: it needs {lacking or 'another simulation'}.")
    return told


def _evidence(decision: Decision) -> Evidence:
    search = decision.search
    dictionary = search.dictionary
    problem, noise = dictionary.problem, decision.noise
    base, whole = search.fit(()), decision.named
    nan = np.where(problem.mask, 0.0, np.nan)
    left, after = residual_of(search, base) + nan, residual_of(search, whole) + nan
    blocks = blocks_of_time(problem, noise)
    shift = whole.coefficients[: len(search.nuisance.names)] / dictionary.scale[list(search.nuisance.columns)]
    moved = dict(zip(search.nuisance.names, shift.tolist(), strict=True))
    values = {name: problem.values.get(name, 0.0) + moved.get(name, 0.0) for name in {**problem.values, **moved}}
    contributions = tuple(
        Contribution(
            term.name,
            term.group.shape,
            tuple((whole.coefficients[whole.of_term(i)] / dictionary.scale[list(term.group.columns)]).tolist()),
            _names(problem, term.wheels),
        )
        for i, term in enumerate(whole.terms)
    )
    return Evidence(
        problem.simulation.channel,
        problem.simulation.unit,
        problem.time_s[:, 0],
        problem.recording.wheels,
        problem.measured,
        problem.measured - left,
        problem.measured - after,
        *_map(problem, noise, left, after, blocks),
        _curves(decision, left, after),
        values,
        contributions,
        problem,
    )


def _map(
    problem: Problem, noise: Noise, left: Array, after: Array, blocks: NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    """Return block centres, and block means of the residual along the motion over their standard errors."""
    along = problem.covariates.get("direction", np.ones(problem.mask.shape))
    count = int(blocks.max()) + 1
    centres = np.bincount(blocks, problem.time_s[:, 0], count) / np.bincount(blocks, minlength=count)

    def means(residual: Array) -> Array:
        signed = np.nan_to_num(residual * along)
        sums = np.stack([np.bincount(blocks, signed[:, w], count) for w in range(signed.shape[1])], axis=1)
        counts = np.stack([np.bincount(blocks, problem.mask[:, w], count) for w in range(signed.shape[1])], axis=1)
        errors = noise.deviation * np.sqrt(noise.memory * np.maximum(counts, 1))
        return np.where(counts > 0, sums / errors, np.nan)

    return centres, means(left), means(after)


def _curves(decision: Decision, left: Array, after: Array) -> tuple[Curve, ...]:
    """Return the residual against each covariate, those first along which most stood out before."""
    problem, noise = decision.search.dictionary.problem, decision.noise
    found = []
    concerned = sorted({w for term in decision.whole.terms for w in term.wheels}) or list(range(problem.mask.shape[1]))
    flavours = {"offset": np.ones(problem.mask.shape), "gain": np.sign(problem.filled)}
    if "direction" in problem.covariates:
        flavours["drag"] = problem.covariates["direction"]
    for name, values in problem.covariates.items():
        if name in NOT_FOR_CURVES - {"direction"}:
            continue
        for flavour, factor in flavours.items():
            curve = _curve(name, flavour, values, factor, (left, after), noise, concerned, problem)
            if curve is not None:
                found.append(curve)
    return tuple(sorted(found, key=lambda c: -float(np.mean((c.before / c.standard_error) ** 2))))


def _curve(
    name: str,
    flavour: str,
    values: Array,
    factor: Array,
    residuals: tuple[Array, Array],
    noise: Noise,
    wheels: list[int],
    problem: Problem,
) -> Curve | None:
    kept = problem.mask & np.isfinite(values)
    kept[:, [w for w in range(kept.shape[1]) if w not in wheels]] = False
    chosen = values[kept]
    if chosen.size < 100:
        return None
    edges = np.unique(np.quantile(chosen, np.linspace(0, 1, 25)))
    if len(edges) < 3:
        return None
    place = np.clip(np.searchsorted(edges, chosen, side="right") - 1, 0, len(edges) - 2)
    counts = np.maximum(np.bincount(place, minlength=len(edges) - 1), 1)
    at = np.bincount(place, chosen, len(edges) - 1) / counts
    before, after = (np.bincount(place, (r * factor)[kept], len(edges) - 1) / counts for r in residuals)
    error = float(np.sqrt(np.mean(noise.deviation[wheels] ** 2) * noise.memory)) / np.sqrt(counts)
    names = tuple(problem.recording.wheels[w] for w in wheels)
    return Curve(name, flavour, at, before, after, error, names)
