"""The corrected simulation of one rover: its parameters, and the effects that act in its last recording."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.corrected import (
    corrected_tables,
    deviations_of,
    stated_tables,
    with_deviations,
    write_simulation,
)
from regolithd.calibration.mismatch.errors import MismatchError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm
    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer, FleetEffect
    from regolithd.calibration.mismatch.fleet.told.chosen import Chosen
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]

Told = tuple["Contribution", "FleetEffect"]
"""An effect's term, and the same in the answer."""


def acting_last(chosen: Chosen, answer: FleetAnswer, channel: str = "") -> list[Told]:
    """Return the terms of the effects that act in the last recording of the only rover, as large as they are there.

    Those of all recordings, and those that the last one shows by itself. Nothing of several rovers. `channel` is that
    of the terms; empty where the simulation predicts one alone.
    """
    if len(answer.rovers) > 1:
        return []
    equations, fit = chosen.equations, chosen.beside.fit
    last, found = equations.recordings_of[0][-1], []
    for term, span, effect in zip(fit.named, fit.spans, answer.effects, strict=False):
        factors = fit.factors[span][:, last].max(axis=0)
        wheels = tuple(name for name, factor in zip(equations.wheels, factors, strict=True) if factor != 0)
        if wheels:
            sizes = _of_candidate(term, fit.coefficients[span], len(equations.wheels))
            coefficients = tuple((float(np.max(factors)) * sizes).tolist())
            found.append((Contribution(term.name, term.group.shape, coefficients, wheels, channel=channel), effect))
    return [*found, *_of_recording(chosen, answer, last, channel)]


def _of_recording(chosen: Chosen, answer: FleetAnswer, recording: int, channel: str) -> Iterator[Told]:
    """Yield the terms of the effects that a recording shows by itself."""
    alone = answer.effects[len(chosen.fit.named) :]
    told = {effect.name: effect for effect in alone if effect.recordings == (chosen.names.recordings[recording],)}
    for i, place in chosen.shown.terms:
        term = chosen.found[i].terms[place]
        if i == recording and term.contribution is not None and term.name in told:
            yield replace(term.contribution, channel=channel), told[term.name]


def _of_candidate(term: FleetTerm, sizes: Array, wheels: int) -> Array:
    """Return a term's sizes as its candidate has coefficients of them; 0 of wheels that have others of their own."""
    places = term.group.candidate.columns_of_wheels(term.group.shape, wheels)
    if places is None:
        return sizes
    found = np.zeros(places.size)
    for (_, (wheel,)), own in zip(term.parts, sizes.reshape(len(term.parts), -1), strict=True):
        found[places[wheel]] = own
    return found


def write_corrected(path: Path, answer: FleetAnswer, told: Sequence[Told], simulation: Simulation) -> None:
    """Write SIM.toml with a rover's calibrated parameters and the effects that act in its last recording.

    Raises
    ------
    MismatchError
        When there are several rovers.
    SimulationError
        When the simulation does not come from a SIM.toml.
    """
    if len(answer.rovers) > 1:
        raise MismatchError(
            f"a corrected simulation is of one rover, and these are {len(answer.rovers)}: compare the recordings of one"
        )
    tables, deviations = stated_tables(simulation), deviations_of(answer, simulation)
    values = {each.name: each.value for each in answer.parameters} | deviations
    terms, effects = [term for term, _ in told], [effect for _, effect in told]
    # Beside something unexplained parameters may stand for a part of it.
    imitating = bool(answer.unexplained)
    new = corrected_tables(tables, simulation, values, terms, effects, within_priors=imitating)
    write_simulation(path, simulation, with_deviations(new, simulation, deviations))
