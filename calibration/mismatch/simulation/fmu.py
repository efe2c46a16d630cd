"""A simulation that is an FMU (FMI 2 or 3, co-simulation or model exchange), through FMPy; no Python is written.

    [simulation]
    model = "tank.fmu"                 # beside SIM.toml, or a path

    [fmu]
    channel = "level_m"                # the recorded column that is predicted
    unit = "m"

    [fmu.variables]                    # recorded column = variable of the FMU
    level_m = "tank.h"                 # an output: what is predicted
    pump_voltage_V = "u"               # inputs

    [fmu.covariates]                   # what a residual may depend on = recorded column
    wheel_speed = "pump_speed_rad_s"

    [parameters.area_m2]               # a parameter; `variable` where the FMU calls it otherwise
    variable = "tank.A"
    value = 0.5
    std = 0.01
    unit = "m2"

Each run of the recording is simulated by itself, from its first instant. Results are cached by inputs and values.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import Prior
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]

KEPT_RESULTS = 64
"""Simulated results that are kept (a choice: what one comparison asks for)."""


class FmuSimulation(Simulation):
    """One output of an FMU, from recorded inputs. Build it by `from_file`."""

    def __init__(self, path: Path, tables: Mapping[str, Any]) -> None:
        fmpy = _fmpy()
        table = _table(tables)
        self.channel, self.unit = str(table["channel"]), str(table.get("unit", "1"))  # type: ignore[misc]
        self.wheel_column = str(table.get("wheel_column", "wheel"))  # type: ignore[misc]
        self.stated = tables
        self._description = _described(fmpy, path)
        known = {variable.name: variable for variable in self._description.modelVariables}
        variables = {str(column): str(name) for column, name in table["variables"].items()}
        self._covariates = {str(name): str(column) for name, column in table.get("covariates", {}).items()}
        for column, name in variables.items():
            _variable(known, name, path, f"[fmu.variables] {column}")
        if self.channel not in variables:
            raise SimulationError(f"[fmu.variables] needs {self.channel}, the predicted channel, and its variable")
        self._output = variables.pop(self.channel)
        self._inputs = variables
        self.inputs = tuple(variables)  # type: ignore[misc]
        self.parameters, self._start = _parameters(tables.get("parameters", {}), known, path)
        self._unpacked = Path(tempfile.mkdtemp(prefix="fmu-"))
        weakref.finalize(self, shutil.rmtree, self._unpacked, ignore_errors=True)
        fmpy.extract(str(path), str(self._unpacked))
        self._results: dict[bytes, Array] = {}

    @classmethod
    def from_file(cls, path: Path, tables: Mapping[str, Any]) -> Self:
        """Read the FMU and SIM.toml's tables.

        Raises
        ------
        SimulationError
            When FMPy is not installed, or file and tables do not fit.
        """
        return cls(path, tables)

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Simulate every run and every column, shape (time, wheel)."""
        found: Array = np.full(inputs["t_s"].shape, np.nan)
        for wheel in range(found.shape[1]):
            for run in np.unique(inputs["run"][:, 0]):
                rows = inputs["run"][:, 0] == run
                columns = {column: inputs[column][rows, wheel] for column in self._inputs}
                found[rows, wheel] = self._result(inputs["t_s"][rows, 0], columns, values)
        return found

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the columns that `[fmu.covariates]` names."""
        named = {name: inputs[column] for name, column in self._covariates.items() if column in inputs}
        return {"time": inputs["t_s"], **named}

    def corrected_tables(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return `[parameters]` with the values that the recording gave them."""
        stated = self.stated.get("parameters", {})
        return {"parameters": {name: {**stated[name], "value": float(values[name])} for name in self.parameters}}

    def _result(self, time_s: Array, columns: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        stated = [values[name] for name in self._start]
        key = hashlib.blake2b(
            b"".join(part.tobytes() for part in (time_s, *columns.values(), np.array(stated, np.float64)))
        ).digest()
        if key not in self._results:
            if len(self._results) >= KEPT_RESULTS:
                self._results.pop(next(iter(self._results)))
            self._results[key] = self._simulate(time_s, columns, values)
        return self._results[key]

    def _simulate(self, time_s: Array, columns: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        known = np.all([np.isfinite(column) for column in columns.values()], axis=0) if columns else time_s >= 0
        if known.sum() < 2:
            return np.full(len(time_s), np.nan)
        step_s = float(np.median(np.diff(time_s)))
        names = ["time", *(self._inputs[column] for column in columns)]
        signal = np.zeros(int(known.sum()), [(name, np.float64) for name in names])
        for name, column in zip(names, (time_s, *columns.values()), strict=True):
            signal[name] = column[known]
        try:
            result = _fmpy().simulate_fmu(
                str(self._unpacked),
                model_description=self._description,
                start_time=float(time_s[0]),
                stop_time=float(time_s[-1]),
                output_interval=step_s,
                start_values={variable: values[name] for name, variable in self._start.items()},
                input=signal if columns else None,
                output=[self._output],
            )
        except Exception as error:  # FMPy raises plain Exception for whatever a model does
            raise SimulationError(f"the FMU could not be simulated: {error}") from error
        return np.interp(time_s, result["time"], result[self._output])


def _fmpy() -> Any:  # noqa: ANN401  # a module without types
    try:
        import fmpy  # noqa: PLC0415  # only an FMU needs it
    except ImportError as error:
        raise SimulationError("an FMU needs FMPy: pip install 'regolithd[fmu]'") from error
    return fmpy


def _described(fmpy: Any, path: Path) -> Any:  # noqa: ANN401  # FMPy's own type
    try:
        return fmpy.read_model_description(str(path))
    except Exception as error:  # FMPy raises plain Exception for a damaged file
        raise SimulationError(f"{path} is not an FMU that can be read: {error}") from error


def _table(tables: Mapping[str, Any]) -> Mapping[str, Any]:
    table = tables.get("fmu")
    if not isinstance(table, dict) or "channel" not in table or not isinstance(table.get("variables"), dict):
        raise SimulationError("an FMU needs [fmu] channel, and [fmu.variables] with a variable for each column")
    return table


def _variable(known: Mapping[str, Any], name: str, path: Path, where: str) -> str:
    if name not in known:
        raise SimulationError(f"{where}: {path.name} has no variable {name!r}; it has {', '.join(sorted(known)[:20])}")
    return name


def _parameters(stated: object, known: Mapping[str, Any], path: Path) -> tuple[dict[str, Prior], dict[str, str]]:
    """Return the priors, and the FMU's variable of each."""
    if not isinstance(stated, dict):
        raise SimulationError("[parameters] must be a table of tables: [parameters.NAME] value = …, std = …")
    priors, variables = {}, {}
    for name, fields in stated.items():
        if not isinstance(fields, dict) or set(fields) - {"variable", "value", "std", "unit"}:
            raise SimulationError(f"[parameters.{name}] takes variable, value, std and unit, not {fields!r}")
        variable = _variable(known, str(fields.get("variable", name)), path, f"[parameters.{name}]")
        start = fields.get("value", known[variable].start)
        try:
            priors[name] = Prior(float(start), float(fields.get("std", 0.0)), str(fields.get("unit", "1")))
        except (TypeError, ValueError) as error:
            raise SimulationError(f"[parameters.{name}] value and std must be numbers: {error}") from error
        variables[name] = variable
    return priors, variables
