"""What a recording shows by itself: the first of the two steps that are done recording by recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.reversal import reversal_of
from regolithd.calibration.mismatch.comparison import decided
from regolithd.calibration.mismatch.fleet.work.fleet_curve import memory_of
from regolithd.calibration.mismatch.inference.evidence import calibrated_values, contribution_of
from regolithd.calibration.mismatch.inference.findings import noise_floor
from regolithd.calibration.mismatch.inference.other_answers.probability import leads_of
from regolithd.calibration.mismatch.regression.groups.smooth_groups import as_followed
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.signal.hat_basis import range_of
from regolithd.calibration.mismatch.signal.noise_models.noise import LaggedSums, lagged_sums
from regolithd.calibration.mismatch.simulation.one_channel import OneChannel
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.candidates.responses import Responses
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.inference.findings import Findings
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]
Single = NDArray[np.float32]

NO_READINGS = LaggedSums(*np.zeros((3, 1)))
"""Sums of a recording in which nothing is compared."""


@dataclass(frozen=True, eq=False)
class FoundTerm:
    """A term that a recording shows by itself.

    Attributes
    ----------
    name: the candidate's, or the covariate's of a smooth term
    named: whether it is a candidate
    shape: the candidate's
    wheels: indices
    penalty: what it had to gain, in Δχ²
    columns: shape (column, time, wheel), 0 on other wheels and where nothing is compared
    coupling: of a smooth term, how it acts
    lead: of the recording's own answer over the same without it, by the evidence, in Δχ²; infinite where that is none
    contribution: of a candidate, as a corrected simulation holds it
    """

    name: str
    named: bool
    shape: Shape
    wheels: tuple[int, ...]
    penalty: float
    columns: Single
    coupling: str = ""
    lead: float = inf
    contribution: Contribution | None = None


@dataclass(frozen=True)
class Shapes:
    """A candidate's grid of shapes in one recording, and how far its covariate reaches there."""

    reach: float
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """What was found in one recording, and what the sums over the fleet need of it.

    Attributes
    ----------
    findings: as `regolithd mismatch` has them for this recording alone
    values, late_inputs, late_inputs_on, late, late_on: the parameters at which the simulation was linearised, which
        inputs were put on time there, by how much [s] and on which wheels, and how, and on which wheels, the predicted
        channel is late: as in `Problem`
    deviation, autocorrelation_times: of the noise beside all that was found, shape (wheel,)
    noise_floor: root mean square of what all that was found leaves
    entry_threshold: score above which an effect was named
    terms: named effects, then smooth terms
    shapes: the grid of each candidate that this recording allows, by name
    responses: what is left beside all else that was found has of those that are found over all recordings, by name
    labels: what covariates are called, with their units
    reversal: how friction reverses, empty: at once; None: it has to be computed
    smoothed: inputs that were replaced by their expectation, shape (time, wheel); empty where they have to be computed
    unknown: initial states of runs, by their names, that are far off
    ranges: of each covariate that a curve may be over, where its outermost knots are
    couplings: how such a curve may act, where nothing is known of it, the usual first
    first_s, last_s, step_s: of the recording's instants
    lagged: sums over pairs of readings of what all that was found leaves
    """

    findings: Findings
    values: dict[str, float]
    deviation: Array
    autocorrelation_times: Array | float
    noise_floor: float
    entry_threshold: float
    terms: tuple[FoundTerm, ...]
    shapes: dict[str, Shapes]
    labels: dict[str, str] = field(default_factory=dict)
    late_inputs: dict[str, float] = field(default_factory=dict)
    late_inputs_on: dict[str, tuple[int, ...]] = field(default_factory=dict)
    late: tuple[str, float] | None = None
    late_on: tuple[int, ...] = ()
    responses: dict[str, Responses] = field(default_factory=dict)
    reversal: Shape | None = None
    smoothed: dict[str, Single] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    couplings: tuple[str, ...] = ()
    first_s: float = 0.0
    last_s: float = 0.0
    step_s: float = 0.0
    lagged: LaggedSums = NO_READINGS


def one_channel(simulation: Simulation, channel: str) -> Simulation:
    """Return the simulation of one channel of a simulation that predicts several; else the simulation itself."""
    return OneChannel(simulation, channel) if simulation.channels else simulation


def found_in(recording: Recording, simulation: Simulation, channel: str, thresholds: Thresholds = THRESHOLDS) -> Found:
    """Compare one channel of one recording.

    Raises
    ------
    MismatchError
        When there is nothing to compare.
    """
    of_channel = one_channel(simulation, channel)
    effects = [each for each in simulation.corrected_effects if not simulation.channels or each.channel == channel]
    of_recording = decided(recording, of_channel, effects=effects, thresholds=thresholds)
    decision = of_recording.decision
    problem, whole = decision.equations.problem, decision.whole
    values = {
        name: problem.values[name] for name in calibrated_values(decision.equations, whole) if name in problem.values
    }
    return Found(
        findings=of_recording.findings(),
        values=values,
        deviation=decision.noise.deviation,
        autocorrelation_times=decision.noise.autocorrelation_times,
        noise_floor=noise_floor(decision),
        entry_threshold=decision.entry_threshold,
        terms=tuple(_found_term(decision, index, lead) for index, lead in enumerate(leads_of(decision))),
        shapes=shapes_in(problem, of_recording.candidates),
        labels=dict(problem.labels),
        late_inputs=dict(problem.on_time),
        late_inputs_on=dict(problem.on_time_on),
        late=problem.late,
        late_on=problem.late_on,
        responses=_responses(decision, of_recording.applicable),
        reversal=dict(reversal_of(problem)),
        smoothed={name: values.astype(np.float32) for name, values in problem.smoothed.items()},
        unknown=tuple(sorted(problem.unknown)),
        ranges=_ranges(decision),
        couplings=_couplings(decision),
        first_s=float(problem.time_s[0, 0]),
        last_s=float(problem.time_s[-1, 0]),
        step_s=problem.recording.step_s,
        lagged=lagged_sums(residual_of(decision.equations, whole), problem.mask, decision.noise, thresholds),
    )


def _ranges(decision: Decision) -> dict[str, tuple[float, float]]:
    """Return where the outermost knots are of each covariate that has a smooth term."""
    problem, found = decision.equations.problem, {}
    for name in dict.fromkeys(group.name for group in decision.equations.design.groups if not group.named):
        if name in problem.covariates:
            values = problem.covariates[name]
            known = values[problem.mask & np.isfinite(values)]
            found[name] = range_of(as_followed(name, known))
    return found


def _couplings(decision: Decision) -> tuple[str, ...]:
    """Return how a smooth term may act: on a state that remembers, along the motion, or on the reading."""
    of_terms = {group.coupling for group in decision.equations.design.groups if not group.named}
    on_state = (ON_STATE,) if memory_of(decision.equations.problem) > 0 else ()
    return (*on_state, *(each for each in ("drag", "offset") if each in of_terms))


def _responses(decision: Decision, candidates: Sequence[Candidate]) -> dict[str, Responses]:
    """Return the responses of each candidate that has some, beside all that was found but itself."""
    equations, found = decision.equations, {}
    left = residual_of(equations, decision.whole)
    for candidate in candidates:
        rest = [term for term in decision.whole.terms if term.name != candidate.name]
        is_named = len(rest) < len(decision.whole.terms)
        without = residual_of(equations, equations.fit(rest)) if is_named else left
        each = candidate.responses(equations.problem, without)
        if each is not None:
            found[candidate.name] = each
    return found


def _found_term(decision: Decision, index: int, lead: float) -> FoundTerm:
    equations, whole = decision.equations, decision.whole
    design, term = equations.design, whole.terms[index]
    columns = design.in_time(design.columns_as_read(term.group.columns)).astype(np.float32)
    columns[:, :, [wheel for wheel in equations.all_wheels if wheel not in term.wheels]] = 0.0
    return FoundTerm(
        name=term.name,
        named=term.group.named,
        shape=dict(term.group.shape),
        wheels=term.wheels,
        penalty=equations.penalty(term),
        columns=columns,
        coupling=term.group.coupling,
        lead=lead,
        contribution=contribution_of(equations, whole, index) if term.group.named else None,
    )


def shapes_in(problem: Problem, candidates: Sequence[Candidate]) -> dict[str, Shapes]:
    """Return each applicable candidate's grid, and how far its covariate reaches in this recording."""
    found = {}
    for candidate in candidates:
        if candidate.applies(problem):
            values = problem.covariates.get(candidate.covariate)
            reach = float(np.nanstd(values[problem.mask])) if values is not None else 0.0
            found[candidate.name] = Shapes(reach, tuple(candidate.shapes(problem)))
    return found
