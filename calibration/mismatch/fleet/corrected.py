"""The corrected simulation of one rover: its parameters, and the effects that act in its last recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_tables, write_simulation
from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer, FleetEffect
    from regolithd.calibration.mismatch.fleet.told.findings import Chosen
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Told = tuple["Contribution", "FleetEffect"]
"""An effect's term, and the same in the answer."""


def acting_last(chosen: Chosen, answer: FleetAnswer, channel: str = "") -> list[Told]:
    """Return the terms of the effects that act in the first rover's last recording, as large as they are there.

    `channel` is that of the terms; empty where the simulation predicts one alone.
    """
    equations = chosen.equations.beside(shown_beside(chosen.equations, chosen.fit, chosen.found).terms)
    fit, last = equations.fit(chosen.fit.terms), chosen.equations.recordings_of[0][-1]
    found = []
    for term, span, effect in zip(fit.terms, fit.spans, answer.effects, strict=False):
        size = slice(span.start, span.start + len(term.group.columns))  # of several rovers' sizes the first
        factors = fit.factors[size][0, last]
        wheels = tuple(name for name, factor in zip(equations.wheels, factors, strict=True) if factor != 0)
        if wheels:
            coefficients = tuple((float(np.max(factors)) * fit.coefficients[size]).tolist())
            found.append((Contribution(term.name, term.group.shape, coefficients, wheels, channel=channel), effect))
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
    tables, values = stated_tables(simulation), {each.name: each.value for each in answer.parameters}
    terms, effects = [term for term, _ in told], [effect for _, effect in told]
    # Beside something unexplained parameters may stand for a part of it.
    imitating = bool(answer.unexplained)
    new = corrected_tables(tables, simulation, values, terms, effects, within_priors=imitating)
    write_simulation(path, simulation, new)
