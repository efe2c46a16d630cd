"""Priors as SIM.toml states them: in `[parameters]`, or in any table under the parameter's own name."""

from __future__ import annotations

import math
from dataclasses import replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.prior import Prior

ENGINE_TABLES = ("simulation", "effects")
"""Tables that are no parameters."""


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
    stated: dict[str, dict[str, Any]] = {}
    # `[parameters]` comes last: a corrected file has the calibrated values there, beside the user's own tables.
    for name, table in sorted(tables.items(), key=lambda item: item[0] == "parameters"):
        if name in ENGINE_TABLES or name in own_tables:
            continue
        if not isinstance(table, dict):
            raise SimulationError(
                f"{name} = {table!r}: a parameter stands in a table, as [parameters.{name}] value = …"
            )
        for key, given in table.items():
            if name == "parameters":
                stated.setdefault(_known(key, parameters, "[parameters]"), {}).update(_fields(key, given))
            else:
                _take(key, given, f"[{name}] {key}", parameters, table, stated)
    return {name: replace(prior, **stated.get(name, {})) for name, prior in parameters.items()}


def _fields(parameter: str, given: object) -> dict[str, Any]:
    """Return what `[parameters.NAME]` says."""
    if not isinstance(given, dict) or set(given) - {"value", "std", "unit"}:
        raise SimulationError(f"[parameters.{parameter}] takes value, std and unit, not {given!r}")
    for name in ("value", "std"):
        _number(given.get(name, 0.0), f"[parameters.{parameter}] {name}")
    return given


def _take(
    key: str,
    given: object,
    where: str,
    parameters: Mapping[str, Prior],
    table: Mapping[str, Any],
    stated: dict[str, dict[str, Any]],
) -> None:
    """Take one key of a table of the user's own."""
    for ending, field in (("_relative_std", "std"), ("_std", "std"), ("", "value")):
        name = key.removesuffix(ending) if ending else key
        if (key in parameters and ending) or name not in parameters or (ending and name == key):
            continue
        value = _number(given, where)
        if ending == "_relative_std":
            value *= abs(_number(table.get(name, parameters[name].value), where))
        stated.setdefault(name, {})[field] = value
        return
    _known(key, parameters, where)


def _known(parameter: str, parameters: Mapping[str, Prior], where: str) -> str:
    """Return a parameter's name, if the simulation has it."""
    if parameter not in parameters:
        near = get_close_matches(parameter, parameters, 1)
        meant = f"did you mean {near[0]}?" if near else f"its parameters are {', '.join(parameters) or 'none'}"
        raise SimulationError(f"{where}: the simulation has no parameter {parameter}; {meant}")
    return parameter


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise SimulationError(f"{where}: a finite number is needed, not {value!r}")
    return float(value)
