"""The whole comparison: a recording and a simulation in, an answer and its evidence out.

recording, simulation ─▶ problem ─▶ equations ─▶ decision ─▶ answer, evidence
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.calibration.beside_delay import fitted_where_late
from regolithd.calibration.mismatch.calibration.linearised import (
    added_by,
    beyond_their_doubt,
    late_otherwise,
    linearised_where_it_fits,
    moved_values,
    out_of_bounds,
    put_on_time_by,
    step_to,
    unknown_states,
    untenable,
    worse_than_stated,
)
from regolithd.calibration.mismatch.calibration.starting_values import Start, starting_values
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.candidates.reversal import reversal_of
from regolithd.calibration.mismatch.candidates.sensor_delay import without_delays
from regolithd.calibration.mismatch.changes import (
    corrected_problem,
    stated_in,
    stated_late_inputs,
    stated_late_inputs_on,
    with_changes,
)
from regolithd.calibration.mismatch.channels import compare_channels, labelled
from regolithd.calibration.mismatch.data.recording import as_recording
from regolithd.calibration.mismatch.empirical.found import curves_of
from regolithd.calibration.mismatch.empirical.refuted import without_refuted_curves
from regolithd.calibration.mismatch.empirical.stated import beyond_the_range
from regolithd.calibration.mismatch.inference.beside_spells import named_beside_spells
from regolithd.calibration.mismatch.inference.evidence import empirical_fits, evidence_of
from regolithd.calibration.mismatch.inference.findings import Findings, answer_of, findings_of
from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors, beside_regions, earned
from regolithd.calibration.mismatch.inference.other_answers.improbable import (
    in_probable_regions,
    over_time_if_improbable,
)
from regolithd.calibration.mismatch.inference.parameters.initial_states import with_initial_states
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import information_of
from regolithd.calibration.mismatch.inference.parameters.parameter_information import drawn_for
from regolithd.calibration.mismatch.inference.parameters.same_parameters import with_changes_beside_same_parameters
from regolithd.calibration.mismatch.inference.unexplained.dynamics import notes_on_held_inputs
from regolithd.calibration.mismatch.inference.unexplained.feedback import fed_back, notes_of_feedback
from regolithd.calibration.mismatch.inference.unexplained.opposite_sign import notes_on_opposite_sign
from regolithd.calibration.mismatch.inference.unexplained.shown_direction import notes_on_shown_direction
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.simulated import inputs_of
from regolithd.calibration.mismatch.regression.equations import smooth_equations, with_library
from regolithd.calibration.mismatch.regression.likelihood.reliability import noise_size_of
from regolithd.calibration.mismatch.result import Comparison
from regolithd.calibration.mismatch.selection.by_region.confined import without_confined_laws
from regolithd.calibration.mismatch.selection.decision import as_if_late, decide
from regolithd.calibration.mismatch.simulation.one_channel import OneChannel
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.changes import Stated
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.problem.simulated import Inputs
    from regolithd.calibration.mismatch.regression.group import Group
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.simulation.known_together import Known, KnownTogether
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


FURTHER_SEARCHES = 3
"""Searches at most beside the first, each linearised where the one before led (a choice: most comparisons need
none)."""
LATE_SEARCHES = 4
"""Searches beside a late column, at most (a choice: most need one, parameters that move far as the delay is found two,
a corrected delay that has changed, or one that was taken for another column's at first, up to four)."""

INTERVALS_BESIDE_UNEXPLAINED = (
    "Beside what stays unexplained, values and intervals of effects and parameters hold as far as that does not act as "
    "they do."
)


@dataclass(frozen=True, eq=False)
class Decided:
    """What was decided of one channel.

    Attributes
    ----------
    decision, held_out: the effects that earned their names, and their errors
    candidates: the library in its forms for the simulation
    applicable: those of them that the recording allows
    """

    decision: Decision
    held_out: HeldOutErrors
    candidates: tuple[Candidate, ...]
    applicable: tuple[Candidate, ...]

    def findings(self) -> Findings:
        """Return what was found by itself, without what else could be true."""
        return findings_of(self.decision, self.held_out, self.candidates, self.applicable, drawn_for(self.decision))

    def told(self, simulation: Simulation) -> Comparison:
        """Return the answer and its evidence."""
        problem = self.decision.equations.problem
        drawn = drawn_for(self.decision)
        answer = answer_of(self.decision, self.held_out, self.candidates, self.applicable, drawn)
        evidence = replace(
            evidence_of(self.decision),
            candidates=self.candidates,
            covariate_labels=problem.labels,
            wheel_column=simulation.wheel_column,
        )
        return Comparison(answer, evidence, simulation, information_of(self.decision, drawn))


def compare(
    recording: Recording | object,
    simulation: Simulation,
    *,
    effects: Sequence[Contribution] | None = None,
    thresholds: Thresholds = THRESHOLDS,
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Find where a simulation and a recording differ, and what physics was left out.

    Parameters
    ----------
    recording: as `read_recording` returns it, or a table: a data frame (pandas, polars, pyarrow), a mapping of arrays
    effects: those that the simulation has already; None: its own, as `--corrected` wrote them
    thresholds: the numbers that decide, for studies of them
    progress: called with the name of each stage

    Raises
    ------
    MismatchError
        When there is nothing to compare.
    """
    recorded = as_recording(recording, unit=simulation.wheel_column)
    effects = simulation.corrected_effects if effects is None else effects
    if simulation.channels:

        def of_channel(channel: str, known: Known, together: KnownTogether | None = None) -> Comparison:
            own = [effect for effect in effects if effect.channel == channel]
            one = OneChannel(simulation, channel, known, together)
            return labelled(compare(recorded, one, effects=own, thresholds=thresholds, progress=progress), channel)

        blank = [name for name in simulation.channels if recorded.holds_no_reading(name)]
        channels = [name for name in simulation.channels if name not in blank]
        comparison = compare_channels(simulation, channels or tuple(simulation.channels), of_channel)
        notes = [f"{name} holds no reading: it is not compared." for name in blank]
        return replace(comparison, answer=replace(comparison.answer, notes=(*comparison.answer.notes, *notes)))
    chosen = decided(recorded, simulation, effects=effects, thresholds=thresholds, progress=progress)
    comparison = chosen.told(simulation)
    if chosen.decision.unnamed:
        progress("fitting a curve to what stays unexplained")
    comparison = with_curves(comparison, chosen.decision)
    return replace(comparison, answer=with_initial_states(comparison.answer, chosen.decision))


def with_curves(comparison: Comparison, decision: Decision) -> Comparison:
    """Return the comparison with the empirical curves of what stays unexplained."""
    curves = curves_of(decision)
    told = []
    for term, place in zip(decision.unnamed, comparison.answer.unexplained, strict=True):
        of = next((each for each in curves if any(term is one for one in each.terms)), None)
        told.append(replace(place, curve=of.curve, suggestions=of.suggestions) if of else place)
    notes = beyond_the_range(decision.equations.problem, comparison.simulation.empirical_curves)
    return replace(
        comparison,
        answer=replace(comparison.answer, unexplained=tuple(told), notes=(*comparison.answer.notes, *notes)),
        evidence=replace(comparison.evidence, empirical=empirical_fits(decision, curves)),
    )


def decided(
    recorded: Recording,
    simulation: Simulation,
    *,
    effects: Sequence[Contribution],
    thresholds: Thresholds = THRESHOLDS,
    progress: Callable[[str], None] = lambda _: None,
) -> Decided:
    """Choose the effects in the one channel of a simulation."""
    progress("simulating")
    candidates: Sequence[Candidate] = [each.form_for(simulation) for each in simulation.candidates(library())]
    stated = stated_in(candidates, effects, simulation.stated_effects(), simulation.empirical_curves)

    inputs, on_time = inputs_of(recorded, simulation, thresholds), stated_late_inputs(stated, simulation.inputs)
    pose = _Pose(recorded, simulation, inputs, on_time, stated, thresholds)
    found, start = _settled(candidates, stated, pose, progress)
    if found.decision.unnamed and reversal_of(found.decision.equations.problem):
        # What has no name may have been taken for friction that reverses so, and then no law fits that reverses so.
        at_once, start_at_once = _settled(candidates, stated, replace(pose, at_once=True), progress)
        if at_once.decision.does_without_curves_of(found.decision):
            found, start = at_once, start_at_once
    if found.decision.late_inputs and len(found.decision.whole.terms) > 1:
        # An input that nearly repeats, late by much of what it repeats in, may stand for what has no name.
        candidates = without_delays(candidates, frozenset(found.decision.late_inputs))
        without, start_without = _settled(candidates, stated, pose, progress)
        if without.decision.is_as_probable_as(found.decision):
            found, start = without, start_without
    decision = found.decision
    notes = (
        *_notes_on_values(decision, start),
        *notes_of_feedback(decision.equations.problem),
        *notes_on_held_inputs(recorded, decision.late_inputs, simulation.between_readings),
        *notes_on_opposite_sign(decision),
        *notes_on_shown_direction(decision),
    )
    return replace(found, decision=replace(decision, notes=(*decision.notes, *notes)))


def _settled(
    candidates: Sequence[Candidate], stated: Sequence[Stated], pose: _Pose, progress: Callable[[str], None]
) -> tuple[Decided, Start]:
    """Search until nothing more is fed back, held, unknown, or late without a name; with where the search began."""
    while True:
        start = starting_values(pose(None))
        search = _search(candidates, stated, pose, start, progress)
        if further := fed_back(search.decision) - pose.fed:  # the noise was estimated beside a curve that follows it
            pose = replace(pose, fed=pose.fed | further)
            continue
        found = _decided(search, pose, start, progress)
        further, decision = fed_back(found.decision) - pose.fed, found.decision
        out = out_of_bounds(decision.equations, decision.whole) | beyond_their_doubt(decision.equations, decision.named)
        out |= untenable(decision.equations, decision.whole)
        unknown = unknown_states(decision.equations, decision.whole)
        refused = decision.refused_delays(start.problem) if not further | out | unknown else frozenset()
        if not further | out | unknown | refused:
            return found, start
        pose = replace(pose, fed=pose.fed | further, held=pose.held | out, unknown=pose.unknown | unknown)
        candidates = without_delays(candidates, refused)


def _notes_on_values(decision: Decision, start: Start) -> tuple[str, ...]:
    """Return notes on values of the parameters: others that fit as well, and such that fit only beside a curve."""
    equations, whole = decision.equations, decision.whole
    others = start.notes(equations.problem, added_by(equations, whole)) if start.others else ()
    if not decision.unnamed:
        return others
    return (*others, *worse_than_stated(equations, whole, start.problem), INTERVALS_BESIDE_UNEXPLAINED)


def _decided(search: _Search, pose: _Pose, start: Start, progress: Callable[[str], None]) -> Decided:
    """Keep of a search what held-out readings confirm and what is more probable than chance."""
    if (late := as_if_late(search.decision)) is not None:
        beside = _searched_beside_delays(search, late, pose, progress)
        # A delay that is there explains as much as a free response to the past does; a part of an oscillation less.
        if not beside.decision.unnamed and beside.decision.power_left <= search.decision.power_left:
            search = beside
    progress("measuring on held-out blocks and comparing with rivals")
    decision, held_out = earned(search.decision, search.grid)
    if decision.has_delay and not search.decision.has_delay:  # which was refused before held-out readings asked
        search = _searched_beside_delays(search, decision, pose, progress)
        decision, held_out = earned(search.decision, search.grid)
    confined = without_confined_laws(decision)
    regional = in_probable_regions(confined)
    if regional is not decision:
        decision, held_out = beside_regions(regional, search.grid)
    decision = over_time_if_improbable(without_refuted_curves(decision, start.problem))
    decision, held_out = named_beside_spells(decision, held_out, search.grid)
    decision = with_changes_beside_same_parameters(decision)
    return Decided(decision, held_out, search.candidates, search.applicable)


@dataclass(frozen=True, eq=False)
class _Pose:
    """Poses the problem at values of the parameters.

    Attributes
    ----------
    recorded, simulation, inputs, thresholds: what is compared
    on_time: inputs that a corrected simulation has on time, and how late they are recorded [s]
    stated: effects that the simulation has already
    fed, held, unknown: covariates that follow the noise; what stays as it was stated; initial states that are far off
    at_once: whether friction is taken to reverse at once
    """

    recorded: Recording
    simulation: Simulation
    inputs: Inputs
    on_time: Mapping[str, float]
    stated: Sequence[Stated]
    thresholds: Thresholds
    fed: frozenset[str] = frozenset()
    held: frozenset[str] = frozenset()
    unknown: frozenset[str] = frozenset()
    at_once: bool = False

    def __call__(
        self,
        values: Mapping[str, float] | None,
        late: Mapping[str, float] | None = None,
        late_on: Mapping[str, tuple[int, ...]] | None = None,
    ) -> Problem:
        """Return the problem at these or the stated values, late inputs put on time [s], on `late_on` if not on all."""
        on = {**stated_late_inputs_on(self.stated, self.recorded.wheels), **(late_on or {})}
        posed = partial(build_problem, inputs=self.inputs, late={**self.on_time, **(late or {})}, late_on=on)
        problem = posed(self.recorded, self.simulation, values, thresholds=self.thresholds)
        return replace(
            corrected_problem(problem, self.stated),
            fed_back=self.fed,
            held=self.held,
            unknown=self.unknown,
            at_once=self.at_once,
        )


@dataclass(frozen=True, eq=False)
class _Search:
    """A decision, the groups before any data optimised their shapes, the candidates, and those that apply."""

    decision: Decision
    grid: tuple[Group, ...]
    candidates: tuple[Candidate, ...]
    applicable: tuple[Candidate, ...]


def _search(
    candidates: Sequence[Candidate],
    stated: Sequence[Stated],
    pose: _Pose,
    start: Start,
    progress: Callable[[str], None],
) -> _Search:
    """Search, and again where what was found moves the parameters far, or where a column is late.

    What a delay changes depends on the prediction, so that the simulation is linearised anew beside it, too: with all
    else late with the channel, and with inputs that are late on time.
    """
    equations = linearised_where_it_fits(pose, start)
    candidates = with_changes(equations.problem, candidates, stated)
    found = _search_at(equations, candidates, progress)
    del equations  # memory holds the matrix of one search at a time, and TMPDIR its columns
    for _ in range(FURTHER_SEARCHES):
        step = step_to(found.decision.equations, found.decision.whole)
        if found.decision.has_delay or not (step.is_bent() or step.leads_to_another_law()):
            break
        noise_size = found.decision.equations.problem.noise_size
        del found
        found = _search_at(smooth_equations(replace(pose(step.damped()), noise_size=noise_size)), candidates, progress)
    return _searched_beside_delays(found, found.decision, pose, progress)


def _searched_beside_delays(
    found: _Search, decision: Decision, pose: _Pose, progress: Callable[[str], None]
) -> _Search:
    """Search again with the delays of a decision, until they agree; what was found, where it has none."""
    values = moved_values(decision.equations, decision.whole)
    for _ in range(LATE_SEARCHES if decision.has_delay else 0):
        noise_size = decision.equations.problem.noise_size
        posed = pose(values, decision.late_inputs, decision.late_inputs_on)
        late, on = (decision.late, decision.late_on) if decision.late else (posed.late, posed.late_on)
        problem = replace(posed, late=late, late_on=on, noise_size=noise_size)
        if decision.is_late_alone:
            fitted = fitted_where_late(problem, decision.late_inputs, posed.late[1] if posed.late else 0.0)
            values = fitted.values
            posed = pose(values, fitted.inputs, decision.late_inputs_on)
            problem = replace(posed, late=fitted.channel, late_on=on, noise_size=noise_size)
        again = _search_at(smooth_equations(problem), found.candidates, progress)
        if not again.decision.has_delay:
            break
        found, decision = again, again.decision
        values = moved_values(decision.equations, decision.whole)
        agrees = put_on_time_by(problem, decision.late_inputs, decision.late)
        if agrees and not late_otherwise(problem, values):
            break
    return found


def _search_at(equations: NormalEquations, candidates: Sequence[Candidate], progress: Callable[[str], None]) -> _Search:
    """Search with one linearisation; once more where what is found leaves noise that grows with the predicted size."""
    found = _searched(equations, candidates, progress)
    problem, decision = equations.problem, found.decision
    if problem.noise_size is None and (noise_size := noise_size_of(decision.equations, decision.whole)) is not None:
        del found, decision, equations  # memory holds the matrix of one search at a time
        return _searched(smooth_equations(replace(problem, noise_size=noise_size)), candidates, progress)
    return found


def _searched(equations: NormalEquations, candidates: Sequence[Candidate], progress: Callable[[str], None]) -> _Search:
    progress("computing the columns of all candidates")
    equations, applicable = with_library(equations, candidates)
    progress("searching")
    return _Search(decide(equations, applicable), equations.design.groups, tuple(candidates), applicable)
