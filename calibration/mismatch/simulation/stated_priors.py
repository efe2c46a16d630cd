"""Priors as SIM.toml states them: in `[parameters]`, or in any table under the parameter's own name."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.errors import SimulationError, did_you_mean
from regolithd.calibration.mismatch.problem.prior import Prior

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

ENGINE_TABLES = ("simulation", "effects", "empirical_curves")
"""Tables that are no parameters."""
OWN = "own"
"""The key of the deviations of single wheels from the common value: a table from wheel to number."""
FIELDS = ("value", "std", "unit", OWN)
"""Keys of `[parameters.NAME]`."""
TAKES = "value, std, unit and own"
"""The same in a message."""
SENSORS = "sensors"
"""The table of the errors of recorded inputs; a key of it that is no parameter is one of these."""
GREATEST_NUMBER = 1e100
"""Size of a stated number, or a prediction, up to which its square and its products are numbers (a choice)."""
LEAST_NUMBER = 1e-100
"""Size below which a number is 0."""


def stated_priors(
    tables: Mapping[str, Any], parameters: Mapping[str, Prior], own_tables: Sequence[str] = ()
) -> dict[str, Prior]:
    """Return the priors with what SIM.toml's tables say in their place.

    `[parameters.NAME] value, std` replaces a prior. So does a key of any other table that has a parameter's name:
    `area_m2 = 0.5`, with `area_m2_std` or `area_m2_relative_std` beside it. `own_tables` are not looked at.

    Raises
    ------
    SimulationError
        For a key that is no parameter, or a value that is no finite number.
    """
    if not all(isinstance(prior, Prior) for prior in parameters.values()):
        return dict(parameters)  # the check of the class tells which is none, and where
    stated: dict[str, dict[str, Any]] = {}
    # `[parameters]` comes last: a corrected file has the calibrated values there, beside the user's own tables.
    for name, table in sorted(tables.items(), key=lambda item: item[0] == "parameters"):
        if name in ENGINE_TABLES or name in own_tables:
            continue
        if not isinstance(table, dict):
            raise SimulationError(
                f"{name} = {table!r}: a parameter stands in a table, as [parameters.{name}] value = …", (name,)
            )
        if not table and name != "parameters":
            raise SimulationError(f"[{name}] is empty: remove it, or state a parameter in it", (name,))
        for key, given in table.items():
            if name == "parameters":
                stated.setdefault(_known(key, parameters, "[parameters]", (name, key)), {}).update(_fields(key, given))
            elif name != SENSORS or names_parameter(key, parameters):
                _take((name, key), given, parameters, table, stated)
    return {name: replace(prior, **stated[name]) if name in stated else prior for name, prior in parameters.items()}


def _fields(parameter: str, given: object) -> dict[str, Any]:
    """Return what `[parameters.NAME]` says."""
    keys = ("parameters", parameter)
    if not isinstance(given, dict):
        raise SimulationError(f"[parameters.{parameter}] takes {TAKES}, not {given!r}", keys)
    for name in given:
        if name not in FIELDS:
            told = f"[parameters.{parameter}] takes {TAKES}, not {name}; {did_you_mean(name, FIELDS)}"
            raise SimulationError(told, (*keys, name))
    numbers = {name: finite_number(given[name], (*keys, name)) for name in ("value", "std") if name in given}
    unit = {"unit": str(given["unit"])} if "unit" in given else {}
    return numbers | unit | ({OWN: _own(given[OWN], (*keys, OWN))} if OWN in given else {})


def _own(given: object, keys: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
    """Return each wheel's deviation from the common value."""
    if not isinstance(given, dict):
        raise SimulationError(f"[{'.'.join(keys)}] has a deviation for each wheel, wheel = number, not {given!r}", keys)
    return tuple((wheel, finite_number(value, (*keys, wheel))) for wheel, value in given.items())


def _take(
    keys: tuple[str, str],
    given: object,
    parameters: Mapping[str, Prior],
    table: Mapping[str, Any],
    stated: dict[str, dict[str, Any]],
) -> None:
    """Take one key of a table of the user's own."""
    key = keys[1]
    ending = _ending(key, parameters)
    if ending is None:
        _known(key, parameters, _shown(keys), keys)
        return
    name, value = key.removesuffix(ending), finite_number(given, keys)
    if ending == "_relative_std":
        value *= abs(finite_number(table.get(name, parameters[name].value), (keys[0], name)))
    stated.setdefault(name, {})["std" if ending else "value"] = value


def names_parameter(key: str, parameters: Mapping[str, Prior]) -> bool:
    """Return whether a key of a table is a parameter's value or standard deviation."""
    return _ending(key, parameters) is not None


def _ending(key: str, parameters: Mapping[str, Prior]) -> str | None:
    """Return what follows a parameter's name in a key; None where the key names no parameter. A name comes first."""
    endings = ("", "_relative_std", "_std")
    return next((each for each in endings if key.endswith(each) and key.removesuffix(each) in parameters), None)


def _known(parameter: str, parameters: Mapping[str, Prior], where: str, keys: tuple[str, ...]) -> str:
    """Return a parameter's name, if the simulation has it."""
    if parameter not in parameters:
        told = f"{where}: the simulation has no parameter {parameter}; {did_you_mean(parameter, parameters)}"
        raise SimulationError(told, keys)
    return parameter


def check_keys_of_simulation(table: Iterable[str], known: Sequence[str]) -> None:
    """Check that every key of `[simulation]` is a known one: another would be taken without a word."""
    for name in table:
        if name not in known:
            raise SimulationError(f"[simulation] has no key {name}; {did_you_mean(name, known)}", ("simulation", name))


def finite_number(value: object, keys: tuple[str, ...]) -> float:
    """Return a number; a standard deviation is not negative, and one whose square has no digits is 0."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not _is_finite(value):
        raise SimulationError(f"{_shown(keys)}: a finite number is needed, not {value!r}", keys)
    if value < 0 and (keys[-1] == "std" or keys[-1].endswith("_std") or (keys[0] == SENSORS and "_std_" in keys[-1])):
        raise SimulationError(f"{_shown(keys)}: a standard deviation is 0 (exact) or more, not {value!r}", keys)
    if abs(value) > GREATEST_NUMBER:
        raise SimulationError(f"{_shown(keys)}: a number up to {GREATEST_NUMBER:g} is needed, not {value!r}", keys)
    return float(value) if abs(value) >= LEAST_NUMBER else 0.0


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the greatest float
        return False


def _shown(keys: tuple[str, ...]) -> str:
    """Return ("parameters", "mass_kg", "value") as "[parameters.mass_kg] value"."""
    return f"[{'.'.join(keys[:-1])}] {keys[-1]}"
