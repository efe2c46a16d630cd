"""The simulation where the beginning of a recording linearises it: residual, tangents and laws of any later piece."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.linearised import linearised_where_it_fits
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in, with_changes
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.online.laws import Law, allowed, law_columns, laws_of, wheel_sets_of
from regolithd.calibration.mismatch.online.left_out import (
    Usual,
    left_out_of,
    reasons_of,
    since_before,
    stuck,
    usual_of,
)
from regolithd.calibration.mismatch.online.pieces import together
from regolithd.calibration.mismatch.online.scores import Search
from regolithd.calibration.mismatch.online.sums import Interval
from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS, OnlineThresholds
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.regression.nuisance import tangents

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.changes import Stated
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.online.pieces import Piece
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Linearised:
    """What the beginning of a recording has fixed for the rest of it.

    Attributes
    ----------
    simulation: of one channel
    values: the parameters' values where it is linearised
    wheels: names
    laws: that are searched for
    sets: of wheels, by indices
    search: what may be where
    left_out: names of candidates that are not searched for
    covariates: names of those that the beginning had
    usual: how the readings were at the beginning
    limits: the numbers that decide
    """

    simulation: Simulation
    stated: tuple[Stated, ...]
    values: Mapping[str, float]
    wheels: tuple[int | str, ...]
    laws: tuple[Law, ...]
    sets: tuple[tuple[int, ...], ...]
    search: Search
    left_out: tuple[str, ...]
    covariates: tuple[str, ...]
    usual: Usual
    limits: OnlineThresholds

    def interval(self, piece: Piece, before: Piece | None) -> Interval:
        """Return what is compared in a piece; the rows of the piece before it lead up to it.

        Raises
        ------
        RecordingError
            When too little of it can be compared.
        """
        pieces = [each for each in (before, piece) if each is not None]
        recording, elapsed = together(pieces, self.wheels)
        problem = self.pose(recording, elapsed)
        stays = stuck(problem, elapsed, self.usual, self.limits)
        earlier = stays[elapsed < piece.start_s] if before else stays[:0]
        found = self._of(problem, recording, elapsed, stays, piece)
        if not earlier.any():
            return found
        return replace(found, stuck_before=earlier, left_out=since_before(found.left_out, earlier, elapsed))

    def intervals(
        self, problem: Problem, recording: Recording, elapsed: Array, pieces: Sequence[Piece]
    ) -> list[Interval]:
        """Return what is compared in each of the pieces that a problem was posed of together."""
        stays = stuck(problem, elapsed, self.usual, self.limits)
        return [self._of(problem, recording, elapsed, stays, piece) for piece in pieces]

    def pose(self, recording: Recording, elapsed: Array) -> Problem:
        """Return the problem at the values, with the covariates that are constant in this piece.

        One that the beginning had and this piece lacks is blank: what depends on it is not looked for here.
        """
        problem = _posed(recording, elapsed, self.simulation, self.values, self.stated)
        blank = np.full(problem.mask.shape, np.nan)
        return replace(problem, covariates={**dict.fromkeys(self.covariates, blank), **problem.covariates})

    def _of(self, problem: Problem, recording: Recording, elapsed: Array, stays: Mask, piece: Piece) -> Interval:
        here = (elapsed >= piece.start_s) & (elapsed < piece.end_s)
        mask = problem.mask & here[:, None] & ~stays
        names, _, beside = tangents(problem)
        parameters = self.simulation.parameters
        residual = problem.measured - problem.filled
        for name, column in zip(names, beside, strict=True):
            if name in parameters:  # measured from the stated values, where the priors are centred
                residual = residual + (self.values[name] - parameters[name].value) * column
        instants = here & np.isfinite(problem.prediction).any(axis=1)
        columns = np.concatenate((np.stack(np.broadcast_arrays(*beside, mask)[:-1]), law_columns(problem, self.laws)))
        return Interval(
            piece.start_s,
            piece.end_s,
            columns=np.where(mask, columns, 0.0)[:, here],
            residual=np.where(mask, residual, 0.0)[here],
            mask=mask[here],
            size=float(np.sum(np.abs(problem.measured[mask]))),
            left_out=left_out_of(reasons_of(problem, recording, stays), mask, instants, elapsed),
        )


def _posed(
    recording: Recording,
    elapsed: Array,
    simulation: Simulation,
    values: Mapping[str, float] | None,
    stated: Sequence[Stated],
) -> Problem:
    """Return the problem of some pieces; `elapsed` is the time since the start, on whose clock an onset is [s]."""
    problem = build_problem(recording, simulation, values)
    since_start = {**problem.covariates, "time": problem.covariates["time"] + elapsed[0]}
    problem = corrected_problem(replace(problem, covariates=since_start), stated)
    return replace(problem, covariates={**problem.constants, **problem.covariates}, constants={})


def check_comparable(piece: Piece, simulation: Simulation) -> None:
    """Check that a piece alone can be compared, before it is learned from.

    Raises
    ------
    RecordingError
        When it cannot: the machine stands, or an input is missing.
    """
    recording, _ = together([piece])
    build_problem(recording, simulation)


def learned(
    pieces: Sequence[Piece], simulation: Simulation, limits: OnlineThresholds = ONLINE_THRESHOLDS
) -> tuple[Linearised, list[Interval]]:
    """Linearise a simulation of one channel on the first pieces; return it with their intervals.

    Raises
    ------
    RecordingError
        When too little of them can be compared.
    SimulationError
        When the simulation depends on more than the rows just before, so that pieces cannot be compared one by one.
    """
    recording, elapsed = together(pieces)
    candidates = tuple(each.form_for(simulation) for each in simulation.candidates(library()))
    stated = stated_in(candidates, simulation.corrected_effects, simulation.stated_effects())
    problem = linearised_where_it_fits(lambda values: _posed(recording, elapsed, simulation, values, stated)).problem
    candidates = with_changes(problem, candidates, stated)
    laws = laws_of(problem, candidates)
    sets, wheels = wheel_sets_of(problem), problem.recording.wheels
    at_start, later = allowed(laws, law_columns(problem, laws), sets, len(wheels))
    _, stds, _ = tangents(problem)
    search = Search(
        precision=1 / np.array(stds) ** 2,
        member=np.array([[float(w in chosen) for w in range(len(wheels))] for chosen in sets]),
        at_start=at_start,
        later=later,
        signs=np.array([law.sign for law in laws], np.float64),
        least_tolerance=problem.thresholds.least_tolerance,
        smallest_effect=problem.thresholds.smallest_effect,
    )
    names = dict.fromkeys(law.name for law in laws)
    left_out = tuple(dict.fromkeys(each.name for each in candidates if each.name not in names))
    known, usual = tuple(problem.covariates), usual_of(problem)
    found = Linearised(simulation, stated, problem.values, wheels, laws, sets, search, left_out, known, usual, limits)
    _check_memory(found, problem, pieces)
    return found, found.intervals(problem, recording, elapsed, pieces)


def _check_memory(found: Linearised, problem: Problem, pieces: Sequence[Piece]) -> None:
    """Compare the last piece as predicted after all before it, and after one piece before it alone.

    Both are predicted from the same inputs. Smoothed with fewer rows they would be others, and a simulation that
    carries nothing would seem to.
    """
    _, elapsed = together(pieces[-2:], found.wheels)
    last, values = slice(-len(elapsed), None), {**found.simulation.variants(), **found.values}
    inputs = problem.recording
    channels = {name: read[last] for name, read in inputs.channels.items()}
    short = replace(inputs, time_s=inputs.time_s[last], run=inputs.run[last], channels=channels)
    whole, alone = (found.simulation.predict(complete_inputs(each), values) for each in (inputs, short))
    here = elapsed >= pieces[-1].start_s
    difference = (whole[last] - alone)[here][problem.mask[last][here]]
    known = difference[np.isfinite(difference)]
    apart = float(np.sqrt(np.mean(known**2))) if known.size else 0.0
    residual = float(np.sqrt(np.mean((problem.measured - problem.filled)[problem.mask] ** 2)))
    if apart > problem.thresholds.carried_share * residual:
        raise SimulationError(
            f"the prediction of the last {pieces[-1].end_s - pieces[-1].start_s:.0f} s depends on what was long before "
            f"(by {apart / residual:.2f} of the residual): a simulation that carries its state so far cannot be "
            "followed piece by piece. Compare the whole recording with `regolithd mismatch` when it has ended."
        )
