"""Standard errors of recorded inputs as SIM.toml's `[sensors]` states them, for a class or an FMU.

    [sensors]
    speed_std_rad_s = 0.02        # column speed_rad_s: 0.02 rad/s
    load_relative_std = 0.01      # column load_N, of which the simulation knows: 1 % of the reading
    opening_std = 0.5             # column opening

`rover-wheel` reads the same table with keys of its own.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Protocol

from regolithd.calibration.mismatch.errors import SimulationError, did_you_mean
from regolithd.calibration.mismatch.problem.covariates import quantity
from regolithd.calibration.mismatch.problem.predictor import Predictor
from regolithd.calibration.mismatch.problem.prior import SensorError
from regolithd.calibration.mismatch.simulation.stated_priors import SENSORS, finite_number, names_parameter

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

EXAMPLE = "write speed_std_rad_s = 0.02 for the column speed_rad_s, or load_relative_std = 0.02 for load_N"
KEY = re.compile(r"(?P<quantity>.+?)(?:_(?P<relative>relative))?_std(?:_(?P<unit>.+))?")


class WithSensors(Predictor, Protocol):
    """A simulation as it is loaded from a SIM.toml."""

    @property
    def channels(self) -> Mapping[str, str]:
        """Predicted columns with their units, where there are several."""

    @property
    def own_tables(self) -> tuple[str, ...]:
        """Tables of SIM.toml that the simulation reads itself."""

    @property
    def stated(self) -> Mapping[str, Any]:
        """SIM.toml's tables."""


def stated_sensors(tables: Mapping[str, Any], simulation: WithSensors) -> Mapping[str, SensorError]:
    """Return the errors of inputs by column: the simulation's own, with those of `[sensors]` in their place.

    Parameters
    ----------
    tables: of SIM.toml; a simulation that reads `[sensors]` itself names it in `own_tables`

    Raises
    ------
    SimulationError
        For a key that names no error, or a value that is no number.
    """
    table = tables.get(SENSORS, {})
    if SENSORS in simulation.own_tables or not table:
        return simulation.sensors
    if not isinstance(table, dict):
        raise SimulationError(f"[{SENSORS}] must be a table: {EXAMPLE}", (SENSORS,))
    known = {*simulation.inputs, *simulation.channels, *simulation.sensors}
    stated: dict[str, dict[str, float]] = {}
    for key, value in table.items():
        if not names_parameter(key, simulation.parameters):
            column, kind = _meant(key, known)
            stated.setdefault(column, {})[kind] = finite_number(value, (SENSORS, key))
    return {**simulation.sensors, **{column: SensorError(**kinds) for column, kinds in stated.items()}}


def unrecorded(simulation: WithSensors, of_class: Collection[str], columns: Collection[str]) -> list[str]:
    """Return notes of columns that `[sensors]` names, and not the class, and that are neither recorded nor derived."""
    if SENSORS not in simulation.stated:
        return []
    return [
        f"[{SENSORS}] states an error of {name}, a column that nobody recorded; {did_you_mean(name, columns)}"
        for name in simulation.sensors
        if name not in {*of_class, *columns}
    ]


def _meant(key: str, known: Collection[str]) -> tuple[str, str]:
    """Return the column and the field of `SensorError` that a key means."""
    found = KEY.fullmatch(key)
    if found is None or (found["relative"] and found["unit"]):
        raise SimulationError(f"[{SENSORS}] {key} is no standard deviation of a column: {EXAMPLE}", (SENSORS, key))
    if found["unit"]:
        return f"{found['quantity']}_{found['unit']}", "absolute"
    return _column(found["quantity"], known), "relative" if found["relative"] else "absolute"


def _column(name: str, known: Collection[str]) -> str:
    """Return the column of a name with or without its unit."""
    meant = [column for column in known if quantity(column) == name]
    return meant[0] if name not in known and len(meant) == 1 else name
