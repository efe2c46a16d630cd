"""The corrected simulation: SIM.toml with the effects in it, and a simulation that has such effects.

Drivetrain terms that the daemon has too go into its tables; the others stand in `[[effects]]`, each with its shape,
its coefficients and its wheels, and are added to the prediction when the file is read again.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Contribution, Effect
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import own_name

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]

FURTHEST_STD = 3.0
NINE_TENTHS_WIDTH = 2 * 1.645
"""How many standard deviations a 90 % interval is wide."""


def corrected_tables(
    tables: Mapping[str, Any],
    simulation: Simulation,
    values: Mapping[str, float],
    contributions: Sequence[Contribution],
    effects: Sequence[Effect] = (),
) -> dict[str, Any]:
    """Return SIM.toml's tables with the calibrated parameters and every effect.

    `effects` say how sure the contributions are, in the same order; left out, nothing is written of that.
    """
    corrected = {**tables, **simulation.corrected_tables(_within_reason(simulation, values))}
    shares = [_relative_std(effect) for effect in effects] or [0.0] * len(contributions)
    rest = [
        {**{name: _toml(value) for name, value in asdict(effect).items()}, "relative_std": share}
        for effect, share in zip(contributions, shares, strict=True)
        if not _into_drivetrain(corrected, simulation, effect, share)
    ]
    before = list(tables.get("effects", []))
    if before or rest:
        corrected["effects"] = before + rest
    return corrected


def _within_reason(simulation: Simulation, values: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters no further from what was stated than it can be off: three standard deviations.

    Where something is missing that has no name, the parameters lean over to stand in for it.
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


def _relative_std(effect: Effect) -> float:
    """Return the relative standard deviation of an effect's size, whose 90 % interval is known."""
    size = effect.parameters.get("relative_size")
    return 0.0 if size is None or size.value == 0 else (size.high - size.low) / NINE_TENTHS_WIDTH / size.value


def _into_drivetrain(tables: dict[str, Any], simulation: Simulation, effect: Contribution, share: float) -> bool:
    """Put Coulomb and viscous friction where the daemon keeps them; say whether that could be done."""
    drivetrain = tables.get("drivetrain")
    if simulation.channel != "motor_current_A" or not isinstance(drivetrain, dict):
        return False
    six: Array = np.isin(np.arange(1, 7), effect.wheels).astype(np.float64)
    (value, *_) = effect.coefficients
    if effect.name == "coulomb-friction" and value >= 0:
        _add(drivetrain, "no_load_current_A", value * six)
        _add_squared(drivetrain, "no_load_current_std_A", share * value * six)
        return True
    if effect.name == "viscous-friction" and value >= 0 and abs(float(effect.shape["power"]) - 1) < 1e-9:
        # The daemon's viscous term is per motor speed, the effect's per wheel speed.
        ratio = drivetrain["planetary_ratio"] * drivetrain["harmonic_ratio"]
        _add(drivetrain, "viscous_current_A_s_per_rad", value / ratio * six)
        _add_squared(drivetrain, "viscous_current_std_A_s_per_rad", share * value / ratio * six)
        return True
    return False


def _add(drivetrain: dict[str, Any], name: str, six: Array) -> None:
    drivetrain[name] = (np.array(_six(drivetrain, name)) + six).tolist()


def _add_squared(drivetrain: dict[str, Any], name: str, six: Array) -> None:
    drivetrain[name] = np.hypot(_six(drivetrain, name), six).tolist()


def _six(drivetrain: Mapping[str, Any], name: str) -> list[float]:
    before = drivetrain.get(name, 0.0)
    return [float(v) for v in before] if isinstance(before, list | tuple) else [float(before)] * 6


def _toml(value: object) -> object:
    if isinstance(value, dict):
        return {k: _toml(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_toml(v) for v in value]
    return float(value) if isinstance(value, float) else value


def stated_effects(tables: Mapping[str, Any]) -> tuple[Contribution, ...]:
    """Return the effects that SIM.toml has already.

    Raises
    ------
    SimulationError
        When one of them is not as `--corrected` writes it.
    """
    found = []
    for number, effect in enumerate(tables.get("effects", []), 1):
        try:
            found.append(
                Contribution(
                    str(effect["name"]),
                    dict(effect["shape"]),
                    tuple(float(c) for c in effect["coefficients"]),
                    tuple(int(w) for w in effect["wheels"]),
                )
            )
        except (KeyError, TypeError, ValueError) as error:
            raise SimulationError(f"effect {number} needs name, shape, coefficients and wheels: {error}") from error
    return tuple(found)


def effect_of(problem: Problem, candidates: Sequence[Candidate], effects: Sequence[Contribution]) -> Array:
    """Return what stated effects add to the prediction, shape (time, wheel)."""
    known = {candidate.name: candidate for candidate in candidates}
    total = np.zeros(problem.mask.shape)
    for effect in effects:
        if effect.name not in known:
            raise SimulationError(f"there is no effect {effect.name!r}; known are {', '.join(sorted(known))}")
        columns = np.where(problem.mask, known[effect.name].columns(problem, effect.shape), 0.0)
        on = np.isin(problem.recording.wheels, effect.wheels)
        total += np.einsum("c,ctw,w->tw", np.array(effect.coefficients), columns, on)
    return total


def to_toml(tables: Mapping[str, Any]) -> str:
    """Write tables as TOML: what SIM.toml needs, and no more of the language."""
    lines: list[str] = []
    for name, table in tables.items():
        if isinstance(table, dict):
            lines += [f"[{name}]", *_keys(table), ""]
            for inner, below in table.items():
                if isinstance(below, dict):
                    lines += [f"[{name}.{inner}]", *_keys(below), ""]
    for effect in tables.get("effects", []):
        lines += ["[[effects]]", *_keys(effect), ""]
    return "\n".join(lines)


def _keys(table: Mapping[str, Any]) -> list[str]:
    inline = {"shape"}
    return [f"{k} = {_value(v)}" for k, v in table.items() if not isinstance(v, dict) or k in inline]


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return str(value)
