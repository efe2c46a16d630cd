"""Sums of products of one recording: the second step that is done recording by recording.

Columns, in this order: the simulation's tangents (free parameters, each wheel's own deviations, sizes of corrected
effects), the candidates of the fleet's grid, and what the recording shows by itself. All are in physical units, so that
sums of different recordings add up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import as_shown, columns_of
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.candidates.reversal import keep_reversal
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in
from regolithd.calibration.mismatch.fleet.work.fleet_curve import FleetCurve
from regolithd.calibration.mismatch.fleet.work.found import one_channel
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.simulated import inputs_of
from regolithd.calibration.mismatch.problem.state.initial_states import initial_states
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.groups.candidate_groups import implausibility
from regolithd.calibration.mismatch.regression.nuisance import from_priors, tangents
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]

PIECE = 4096
"""Instants that are summed at once (a choice: a few MiB)."""
Laws = tuple[tuple[str, "Shape"], ...]
"""Names and shapes of the candidates of the fleet's grid."""


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the readings of one recording that are compared.

    Attributes
    ----------
    wheels: names
    tangents: names of the simulation's tangents
    prior_stds: of their coefficients, shape (tangent,)
    places: the columns of each law of the grid; fewer than it has coefficients, or none, where it does not apply
    penalties: Δχ² that each law must gain for being hardly possible, shape (law,)
    own: the columns of each term that the recording shows by itself
    gram: shape (wheel, column, column)
    moment: with the residual of the stated simulation, shape (wheel, column)
    fourth: sums of fourth powers, shape (wheel, column)
    energy, counts: sum of squares of that residual, and readings, shape (wheel,)
    weights: one over the long-run variance of the noise, shape (wheel,)
    blocks: weighted moments of each block of time with what the own terms leave, shape (block, wheel, column)
    mean_size: the channel's mean magnitude
    wheel_sets: sets of wheels, by indices, that may share an effect
    reductions: long-run variance of the noise over that at the frequencies of each law's columns, shape (law,)
    """

    wheels: tuple[int | str, ...]
    tangents: tuple[str, ...]
    prior_stds: Array
    places: tuple[tuple[int, ...], ...]
    penalties: Array
    own: tuple[tuple[int, ...], ...]
    gram: Array
    moment: Array
    fourth: Array
    energy: Array
    counts: Array
    weights: Array
    blocks: Array
    mean_size: float
    wheel_sets: tuple[tuple[int, ...], ...]
    reductions: Array


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns of a recording, shape (column, time, wheel), and which of them belong to what."""

    values: Array
    tangents: tuple[str, ...]
    prior_stds: Array
    shifts: Array
    places: tuple[tuple[int, ...], ...]
    own: tuple[tuple[int, ...], ...]


def sums_of(
    recording: Recording,
    simulation: Simulation,
    channel: str,
    laws: Laws,
    found: Found,
    thresholds: Thresholds = THRESHOLDS,
) -> Sums:
    """Return the sums of one recording, with the candidates of the fleet's grid in their shapes."""
    of_channel = one_channel(simulation, channel)
    candidates = {each.name: each for each in (*forms_of(of_channel), FleetCurve())}
    problem = _posed(recording, simulation, of_channel, found, thresholds)
    shaped = [(candidates[name], shape) for name, shape in laws]
    columns = _columns(problem, shaped, found.terms)
    # Measured from the stated values, not from where this recording's own comparison linearised the simulation.
    residual = problem.residual + np.einsum("c,ctw->tw", columns.shifts, columns.values[: len(columns.shifts)])
    noise = NoiseModel(found.deviation, found.autocorrelation_times)
    _whiten_by_initial_states(problem, columns.values, residual, noise)
    gram, moment, fourth = _products(columns.values, residual)
    left = _left(columns, residual, gram, moment, noise)
    return Sums(
        wheels=problem.recording.wheels,
        tangents=columns.tangents,
        prior_stds=columns.prior_stds,
        places=columns.places,
        penalties=_penalties(problem, shaped, columns.places),
        own=columns.own,
        gram=gram,
        moment=moment,
        fourth=fourth,
        energy=np.sum(residual**2, axis=0),
        counts=problem.mask.sum(axis=0).astype(np.float64),
        weights=noise.weights,
        blocks=_block_moments(problem, columns, left, noise),
        mean_size=problem.mean_size,
        wheel_sets=problem.wheel_sets,
        reductions=_reductions(problem, shaped, columns.places, left, noise),
    )


def _reductions(
    problem: Problem,
    laws: Sequence[tuple[Candidate, Shape]],
    places: Sequence[tuple[int, ...]],
    left: Array,
    noise: NoiseModel,
) -> Array:
    """Return the noise's autocorrelation time over that at the frequencies of each law, at least 1."""
    here = [
        candidate.autocorrelation_time_at(problem, left, shape) if own else np.inf
        for (candidate, shape), own in zip(laws, places, strict=True)
    ]
    return np.maximum(noise.autocorrelation_time / np.array(here), 1.0)


def _penalties(problem: Problem, laws: Sequence[tuple[Candidate, Shape]], places: Sequence[tuple[int, ...]]) -> Array:
    """Return the Δχ² that each law must gain for being hardly possible; 0 where it does not apply."""
    found = [implausibility(problem, *law) if own else 0.0 for law, own in zip(laws, places, strict=True)]
    return np.array(found)


def forms_of(simulation: Simulation) -> tuple[Candidate, ...]:
    """Return the candidates in the forms that they have for a simulation of one channel."""
    return tuple(each.form_for(simulation) for each in simulation.candidates(library()))


def _posed(
    recording: Recording, simulation: Simulation, of_channel: Simulation, found: Found, thresholds: Thresholds
) -> Problem:
    """Return the problem where the recording's own comparison linearised it."""
    effects = [
        each for each in simulation.corrected_effects if not simulation.channels or each.channel == of_channel.channel
    ]
    stated = stated_in(forms_of(of_channel), effects, of_channel.stated_effects(), of_channel.empirical_curves)
    smoothed = {name: values.astype(np.float64) for name, values in found.smoothed.items()}
    inputs = inputs_of(recording, of_channel, thresholds, smoothed=smoothed)
    late = found.late_inputs
    problem = build_problem(
        recording,
        of_channel,
        found.values,
        inputs=inputs,
        late=late,
        late_on=found.late_inputs_on,
        thresholds=thresholds,
    )
    problem = replace(
        corrected_problem(problem, stated), late=found.late, late_on=found.late_on, unknown=frozenset(found.unknown)
    )
    if found.reversal is not None:
        keep_reversal(problem, found.reversal)
    return problem


def _columns(problem: Problem, laws: Sequence[tuple[Candidate, Shape]], terms: Sequence[FoundTerm]) -> _Columns:
    names, stds, made = tangents(problem)
    shifts = -np.array(from_priors(problem, names))
    count, places = len(made), []
    for candidate, shape in laws:
        fresh = _of_law(problem, candidate, shape) if candidate.applies(problem) else ()
        places.append(tuple(range(count, count + len(fresh))))
        made, count = [*made, *fresh], count + len(fresh)
    own = []
    for term in terms:
        own.append(tuple(range(count, count + len(term.columns))))
        made, count = [*made, *term.columns.astype(np.float64)], count + len(term.columns)
    whole = problem.mask.shape
    values = np.where(problem.mask, np.stack([np.broadcast_to(each, whole) for each in made]), 0.0)
    return _Columns(values, tuple(names), np.array(stds), shifts, tuple(places), tuple(own))


def _whiten_by_initial_states(problem: Problem, values: Array, residual: Array, noise: NoiseModel) -> None:
    """Give each run of the recording an initial state of its own: whiten columns and residual, in place.

    What an initial state changes, s, with its prior variance v, adds v s s' to the covariance I/w of the noise. The
    inverse square root of the sum, over that of the noise, is I - (1 - 1/sqrt(1 + v w s's)) s s'/(s's): the products of
    what it is applied to are those of a fit in which each initial state is free within its prior.

    Parameters
    ----------
    values, residual: shape (column, time, wheel), (time, wheel)
    """
    states = tuple(initial_states(problem))
    for state, shown in zip(states, as_shown(problem, [state.column for state in states]), strict=True):
        here = state.rows, state.wheel
        course = np.where(problem.mask[here], shown[here], 0.0)
        energy = float(course @ course)
        if energy == 0:
            continue
        taken = (1 - 1 / np.sqrt(1 + state.std**2 * noise.weights[state.wheel] * energy)) / energy * course
        values[:, *here] -= np.outer(values[:, *here] @ course, taken)
        residual[here] -= (residual[here] @ course) * taken


def _of_law(problem: Problem, candidate: Candidate, shape: Shape) -> Array:
    """Return a law's columns, shape (time, wheel) each; those that each wheel has for itself are put side by side."""
    columns = columns_of(problem, candidate, shape)
    own = candidate.columns_of_wheels(shape, columns.shape[-1])
    return columns if own is None else columns[own].sum(axis=0)


def _products(values: Array, residual: Array) -> tuple[Array, Array, Array]:
    """Return sums of products of columns with each other and the residual, and of fourth powers, for each wheel."""
    columns, instants, wheels = values.shape
    gram, moment = np.zeros((wheels, columns, columns)), np.zeros((wheels, columns))
    fourth = np.zeros((wheels, columns))
    for wheel in range(wheels):
        for start in range(0, instants, PIECE):
            piece = np.ascontiguousarray(values[:, start : start + PIECE, wheel])
            gram[wheel] += piece @ piece.T
            moment[wheel] += piece @ residual[start : start + PIECE, wheel]
            squares = np.square(piece)
            fourth[wheel] += np.einsum("ct,ct->c", squares, squares)
    return gram, moment, fourth


def _left(columns: _Columns, residual: Array, gram: Array, moment: Array, noise: NoiseModel) -> Array:
    """Return what tangents and own terms leave of the residual, shape (time, wheel)."""
    taken = [*range(len(columns.tangents)), *(column for own in columns.own for column in own)]
    fitted = _fitted(gram, moment, noise.weights, taken, columns.prior_stds)
    return np.asarray(residual - np.einsum("c,ctw->tw", fitted, columns.values[taken]))


def _block_moments(problem: Problem, columns: _Columns, left: Array, noise: NoiseModel) -> Array:
    """Return each block's weighted moments with what tangents and own terms leave of the residual."""
    blocks, weighted = blocks_of_time(problem, noise), left * noise.weights
    order = np.argsort(blocks, kind="stable")
    starts = np.flatnonzero(np.diff(blocks[order], prepend=-1))
    sums = [np.add.reduceat((column * weighted)[order], starts, axis=0) for column in columns.values]
    return np.stack(sums, axis=2)


def _fitted(gram: Array, moment: Array, weights: Array, taken: Sequence[int], prior_stds: Array) -> Array:
    """Return the coefficients of these columns, tangents first, held by their priors."""
    at = list(taken)
    matrix = np.einsum("w,wcd->cd", weights, gram[:, at][:, :, at])
    count = len(prior_stds)
    matrix[range(count), range(count)] += 1 / prior_stds**2
    scale = np.sqrt(np.where(np.diag(matrix) > 0, np.diag(matrix), 1.0))
    solved = np.linalg.lstsq(matrix / np.outer(scale, scale), weights @ moment[:, at] / scale, rcond=1e-10)[0]
    return np.asarray(solved / scale)
