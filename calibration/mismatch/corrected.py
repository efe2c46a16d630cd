"""The corrected simulation: SIM.toml with calibrated parameters and the effects that were found.

An effect that the simulation has parameters for goes into them (`Simulation.absorb_effects`). The others are written
to `[[effects]]`, each with its shape, coefficients and wheels, and are added to the prediction when the file is read;
so are curves of what has no name, to `[[empirical_curves]]`, where they are asked for.
"""

from __future__ import annotations

import os
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.candidate import Candidate
from regolithd.calibration.mismatch.empirical.written import summed, with_changed_sizes, with_curves
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import own_name, parted_own_name
from regolithd.calibration.mismatch.signal.normal_interval import std_of_interval
from regolithd.calibration.mismatch.simulation.corrected_curves import TABLE, entry_of, stated_curves
from regolithd.calibration.mismatch.simulation.corrected_effects import stated_effects as stated_effects  # noqa: PLC0414  # for its users
from regolithd.calibration.mismatch.simulation.load import model_folder, read_tables
from regolithd.calibration.mismatch.simulation.stated_priors import OWN

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer, Effect, Evidence
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import StatedCurve
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]

FURTHEST_STD = 3.0
"""Standard deviations of its prior that a parameter may move (a choice: one in 370 lies further)."""


def write_corrected(
    path: Path, answer: Answer, evidence: Evidence, simulation: Simulation, *, empirical: bool = False
) -> None:
    """Write SIM.toml with the calibrated parameters and the effects; the user's comments and order stay.

    In another folder than SIM.toml, `[simulation] path` leads to the user's class or FMU. With `empirical`, it has the
    curves of what stays unexplained too, and the parameters and effects as they were fitted beside these.

    Raises
    ------
    SimulationError
        When the simulation does not come from a SIM.toml, or a curve cannot be carried to another recording.
    """
    tables, terms = stated_tables(simulation), evidence.contributions
    # Beside something unexplained the answer's parameters are those of the fit that has it: others would imitate it.
    imitating = bool(answer.unexplained)
    common = {each.name: each.value for each in answer.parameters if each.name in simulation.parameters}
    deviations = deviations_of(answer, simulation)
    values: Mapping[str, float] = {**evidence.values, **common, **deviations}
    curves: list[StatedCurve] = []
    if empirical and answer.unexplained:
        values, terms, curves = with_curves(answer, evidence)
        imitating = False
    new = corrected_tables(tables, simulation, values, terms, answer.effects, within_priors=imitating, curves=curves)
    write_simulation(path, simulation, with_deviations(new, simulation, deviations))


def deviations_of(answer: Answer, simulation: Simulation) -> dict[str, float]:
    """Return the deviations of single wheels that an answer tells, by the names of their own values."""
    values, found = {each.name: each.value for each in answer.parameters}, {}
    for name in values.keys() - simulation.parameters:
        if of := parted_own_name(name, simulation.parameters):
            found[name] = values[name] - values[of[0]]
    return found


def with_deviations(
    tables: Mapping[str, Any], simulation: Simulation, deviations: Mapping[str, float]
) -> dict[str, Any]:
    """Return SIM.toml's tables with the wheels' deviations that were stated or found, where `[parameters]` has them."""
    own = {name: dict(prior.own) for name, prior in simulation.parameters.items()}
    for name, deviation in deviations.items():
        if of := parted_own_name(name, own):
            own[of[0]][of[1]] = deviation
    stated = tables.get("parameters", {})
    told = {name: {**table, OWN: own[name]} for name, table in stated.items() if own.get(name)}
    return {**tables, "parameters": {**stated, **told}} if told else dict(tables)


def stated_tables(simulation: Simulation) -> dict[str, Any]:
    """Return the tables of the SIM.toml that a simulation comes from.

    Raises
    ------
    SimulationError
        When it comes from none.
    """
    return read_tables(_source_of(simulation))


def _source_of(simulation: Simulation) -> Path:
    if simulation.source is None:
        raise SimulationError("a corrected simulation is a SIM.toml: load the simulation from one, by load_simulation")
    return simulation.source


def write_simulation(path: Path, simulation: Simulation, new: dict[str, Any]) -> None:
    """Write a simulation's SIM.toml with new tables, in which its class or FMU is found from the new place too."""
    source = _source_of(simulation)
    tables = read_tables(source)
    if path.resolve().parent != source.resolve().parent and tables["simulation"]["model"] != "rover-wheel":
        folder = model_folder(tables, source.resolve().parent)
        new["simulation"] = {**new["simulation"], "path": os.path.relpath(folder.resolve(), path.resolve().parent)}
    from regolithd.calibration.toml_document import with_tables  # noqa: PLC0415  # most comparisons write no TOML

    path.write_text(with_tables(source.read_text(encoding="utf-8-sig"), new), encoding="utf-8")


def corrected_tables(
    tables: Mapping[str, Any],
    simulation: Simulation,
    values: Mapping[str, float],
    contributions: Sequence[Contribution],
    effects: Sequence[Effect] = (),
    *,
    within_priors: bool = True,
    curves: Sequence[StatedCurve] = (),
) -> dict[str, Any]:
    """Return SIM.toml's tables with the calibrated parameters and every effect.

    Parameters
    ----------
    tables: of the SIM.toml that was compared
    values: the parameters' values in the fit with the effects
    contributions: the effects' terms
    effects: the same, with their intervals, in the same order; left out, the terms have no standard deviation
    within_priors: whether parameters go no further than three standard deviations of their priors, for a fit that has
        moved them to imitate something unexplained; else the file has the values that the answer calls calibrated
    curves: empirical curves to add
    """
    # Changes of effects that the simulation had already follow the named effects.
    named, changes = contributions[: len(effects)], contributions[len(effects) :]
    held_curves, changes = with_changed_sizes(stated_curves(tables), changes)
    pairs = zip(named, effects, strict=True)
    contributions = [*(_with_stds(term, effect) for term, effect in pairs), *changes]
    held = _within_three_std(simulation, values) if within_priors else values
    calibrated = {**tables, **simulation.corrected_tables(held)}
    corrected, rest = simulation.absorb_effects(calibrated, contributions)
    before = list(tables.get("effects", []))
    if before or rest:
        corrected["effects"] = before + [_entry(effect) for effect in rest]
    if held_curves or curves:
        corrected[TABLE] = [entry_of(curve) for curve in summed([*held_curves, *curves])]
    return corrected


def _entry(effect: Contribution) -> dict[str, Any]:
    """Return an entry of `[[effects]]`; it names its channel where the simulation predicts several."""
    entry: dict[str, Any] = _plain(asdict(effect))
    for name in ("channel", "shape_std", "found_in", "posterior"):
        if not entry[name]:
            del entry[name]
    return entry


def _within_three_std(simulation: Simulation, values: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters, clipped to three standard deviations of their priors.

    Where a structure is unexplained, the fit moves the parameters further than that to imitate it.
    """
    kept = {}
    for name, value in values.items():
        prior = simulation.parameters.get(name)
        reach = 0.0 if prior is None else FURTHEST_STD * prior.std
        kept[name] = value if prior is None else min(max(value, prior.value - reach), prior.value + reach)
    for name in simulation.own_to_each_wheel & set(kept):
        prior = simulation.parameters[name]
        reach = FURTHEST_STD * prior.std
        # A wheel's own part goes no further than the whole may.
        for own in [key for key in kept if key.startswith(own_name(name, ""))]:
            whole = min(max(values[name] + values[own], prior.value - reach), prior.value + reach)
            kept[own] = whole - kept[name]
    return kept


def _with_stds(term: Contribution, effect: Effect) -> Contribution:
    """Return an effect's term with the standard deviations of its size and of its law, from its 90 % intervals.

    The size is known no better than the law as another recording has it, without the discrepancy of this one. Those of
    the law are of what it says anywhere, as a power of the speed; when the effect began is of one recording.
    """
    size = effect.parameters.get("relative_size")
    relative_std = 0.0 if size is None or size.value == 0 else std_of_interval(size.low, size.high) / size.value
    relative_std = max(relative_std, effect.law_std)
    told = {
        name: each for name, each in effect.parameters.items() if name in term.shape and name != Candidate.change_point
    }
    # A number that has its usual value has no interval: nothing was fitted.
    shape_std = {name: std_of_interval(each.low, each.high) for name, each in told.items() if np.isfinite(each.low)}
    return replace(term, relative_std=relative_std, shape_std=shape_std, posterior=effect.posterior)


def _plain(value: Any) -> Any:  # noqa: ANN401  # what TOML can hold
    """Return the value with lists for tuples and Python's floats for NumPy's."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return float(value) if isinstance(value, float) else value
