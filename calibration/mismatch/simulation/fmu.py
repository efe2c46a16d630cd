"""A simulation that is an FMU (FMI 2 or 3, co-simulation or model exchange), through FMPy; no Python is written.

    [simulation]
    model = "tank.fmu"                       # beside SIM.toml, or with its path

    [variables]                              # the FMU's variable = the recorded column
    voltage = "pump_voltage_V"               # an input
    level = "level_m"                        # an output: a channel that is predicted

    [covariates]                             # what left-out physics may depend on = the recorded column
    wheel_speed = "pump_speed_rad_s"

    [parameters.area_m2]                     # a parameter of the FMU that is known with an error
    value = 0.5
    std = 0.01

    [sensors]                                # standard errors of recorded inputs
    pump_voltage_std_V = 0.05

Which variables are inputs, which outputs, and their units, the FMU says. Every mapped output that the recording has is
compared. Each run of the recording is simulated by itself, from its first instant.
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

from regolithd.calibration.mismatch.errors import SimulationError, did_you_mean
from regolithd.calibration.mismatch.problem.prior import Prior
from regolithd.calibration.mismatch.simulation.fmu_inputs import ANY_INSTANT, INSTANT, continuous, follow_inputs
from regolithd.calibration.mismatch.simulation.simulation import Simulation
from regolithd.calibration.mismatch.simulation.stated_priors import (
    SENSORS,
    check_keys_of_simulation,
    finite_number,
)
from regolithd.calibration.mismatch.simulation.stated_sensors import stated_sensors

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]

TABLES = ("simulation", "variables", "covariates", "parameters", SENSORS, "effects", "empirical_curves")
"""Tables of an FMU's SIM.toml."""
PREDICTED = ("output", "local")
"""What variables are, that can be compared with a recorded column."""
OF_SIMULATION = ("model", "path", "wheel_column", "one_way", "motor_constant_at_degC", "without_effects")
"""Keys of its `[simulation]`."""
KEPT_RESULTS = 64
"""Simulated results that are kept (a choice: what one comparison asks for)."""


class FmuSimulation(Simulation):
    """One output of an FMU, from recorded inputs. Build it by `from_file`."""

    def __init__(self, path: Path, tables: Mapping[str, Any]) -> None:
        fmpy = _fmpy()
        _check_keys(tables)
        self.stated = tables
        self._description = _described(fmpy, path)
        known = {variable.name: variable for variable in self._description.modelVariables}
        mapped = _mapped(tables, known, path)
        self._inputs = {column: name for name, column in mapped.items() if known[name].causality == "input"}
        self._outputs = {column: name for name, column in mapped.items() if known[name].causality in PREDICTED}
        if not self._outputs:
            raise SimulationError(f"[variables] maps no output of {path.name} to a column: there is nothing to compare")
        units = {column: str(known[name].unit or "1") for column, name in self._outputs.items()}
        self.channel, self.unit = next(iter(units.items()))  # type: ignore[misc]
        self.channels = units if len(units) > 1 else {}  # type: ignore[misc]
        self.inputs = tuple(self._inputs)  # type: ignore[misc]
        self.wheel_column = str(tables.get("simulation", {}).get("wheel_column", "wheel"))  # type: ignore[misc]
        self.one_way = _stated_flag(tables.get("simulation", {}), "one_way")
        self._covariates = _covariates(tables.get("covariates", {}))
        self._own = _parameters(tables.get("parameters", {}), known, path)
        followed = any(continuous(known[name]) for name in self._inputs.values())
        self.parameters = {**self._own, INSTANT: ANY_INSTANT} if followed else self._own
        self.sensors = stated_sensors(tables, self)
        self._unpacked = Path(tempfile.mkdtemp(prefix="fmu-"))
        weakref.finalize(self, shutil.rmtree, self._unpacked, ignore_errors=True)
        fmpy.extract(str(path), str(self._unpacked))
        self._results: dict[bytes, dict[str, Array]] = {}

    @classmethod
    def from_file(cls, path: Path, tables: Mapping[str, Any]) -> Self:
        """Read the FMU and SIM.toml's tables.

        Raises
        ------
        SimulationError
            When FMPy is not installed, or file and tables do not fit.
        """
        return cls(path, tables)

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Any:  # noqa: ANN401  # one or several
        """Simulate every run and every column: the channel, shape (time, wheel), or a mapping of several."""
        found: dict[str, Array] = {column: np.full(inputs["t_s"].shape, np.nan) for column in self._outputs}
        for wheel in range(inputs["t_s"].shape[1]):
            for run in np.unique(inputs["run"][:, 0]):
                rows = inputs["run"][:, 0] == run
                columns = {column: inputs[column][rows, wheel] for column in self._inputs}
                for column, result in self._result(inputs["t_s"][rows, 0], columns, values).items():
                    found[column][rows, wheel] = result
        return found if self.channels else found[self.channel]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what `[covariates]` names, and every input by the name of its column."""
        named = {name: inputs[column] for name, column in self._covariates.items() if column in inputs}
        plain = {column: inputs[column] for column in self._inputs if column not in self._covariates.values()}
        return {"time": inputs["t_s"], **plain, **named}

    def corrected_tables(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return `[parameters]` with the values that the recording gave them."""
        stated = self.stated.get("parameters", {})
        return {"parameters": {name: {**stated[name], "value": float(values[name])} for name in self._own}}

    def _result(self, time_s: Array, columns: Mapping[str, Array], values: Mapping[str, float]) -> dict[str, Array]:
        stated = [values.get(name, prior.value) for name, prior in self.parameters.items()]
        parts = (time_s, *columns.values(), np.array(stated, np.float64))
        key = hashlib.blake2b(b"".join(part.tobytes() for part in parts)).digest()
        if key not in self._results:
            if len(self._results) >= KEPT_RESULTS:
                self._results.pop(next(iter(self._results)))
            self._results[key] = self._simulate(time_s, columns, values)
        return self._results[key]

    def _simulate(self, time_s: Array, columns: Mapping[str, Array], values: Mapping[str, float]) -> dict[str, Array]:
        known = np.all([np.isfinite(column) for column in columns.values()], axis=0) if columns else time_s >= 0
        if known.sum() < 2:
            return {column: np.full(len(time_s), np.nan) for column in self._outputs}
        names = ["time", *(self._inputs[column] for column in columns)]
        signal = np.zeros(int(known.sum()), [(name, np.float64) for name in names])
        for name, column in zip(names, (time_s, *columns.values()), strict=True):
            signal[name] = column[known]
        fmpy, variables = _fmpy(), {each.name: each for each in self._description.modelVariables}
        try:
            fmu = fmpy.instantiate_fmu(str(self._unpacked), self._description)
            try:
                if columns:
                    follow_inputs(fmu, variables, signal, values.get(INSTANT, ANY_INSTANT.value))
                result = fmpy.simulate_fmu(
                    str(self._unpacked),
                    model_description=self._description,
                    start_time=float(time_s[0]),
                    stop_time=float(time_s[-1]),
                    output_interval=float(np.median(np.diff(time_s))),
                    start_values={name: values[name] for name in self._own},
                    input=signal if columns else None,
                    output=list(self._outputs.values()),
                    fmu_instance=fmu,
                )
            finally:
                fmu.freeInstance()
        except Exception as error:  # FMPy raises plain Exception for whatever a model does
            raise SimulationError(f"the FMU could not be simulated: {error}") from error
        # A model exchange is recorded before and after each event, of which the later reading counts.
        last = np.append(np.diff(result["time"]) > 0, True)
        return {
            column: np.interp(time_s, result["time"][last], result[name][last])
            for column, name in self._outputs.items()
        }


def _fmpy() -> Any:  # noqa: ANN401  # a module without types
    try:
        import fmpy  # noqa: PLC0415  # only an FMU needs it
    except ImportError as error:
        raise SimulationError("an FMU needs FMPy: pip install 'regolithd[fmu]'") from error
    return fmpy


def _described(fmpy: Any, path: Path) -> Any:  # noqa: ANN401  # FMPy's own type
    if not path.exists():
        told = f"there is no file {path}; [simulation] path says where the FMU is, relative to SIM.toml"
        raise SimulationError(told, ("simulation", "model"))
    try:
        return fmpy.read_model_description(str(path))
    except Exception as error:  # FMPy raises plain Exception for a damaged file
        raise SimulationError(f"{path} is not an FMU that can be read: {error}") from error


def _mapped(tables: Mapping[str, Any], known: Mapping[str, Any], path: Path) -> dict[str, str]:
    """Return the FMU's variables and the recorded columns that they are."""
    stated = tables.get("variables")
    if not isinstance(stated, dict) or not stated:
        told = 'an FMU needs [variables]: the FMU\'s variable = "recorded column", for inputs and outputs'
        raise SimulationError(told, ("variables",))
    for name, column in stated.items():
        _check_variable(known, name, path, ("variables", name))
        if not isinstance(column, str):
            told = f"[variables] {name}: the name of a recorded column is needed, not {column!r}"
            raise SimulationError(told, ("variables", name))
        if known[name].dimensions:
            told = f"[variables] {name} is an array: only variables that are one number can be compared with a column"
            raise SimulationError(told, ("variables", name))
        if (kind := known[name].causality) not in {"input", *PREDICTED}:
            told = f"[variables] {name} is neither input nor output of {path.name}, but of the kind {kind}"
            cure = f"; state it as [parameters.{name}] value = …, std = …" if kind == "parameter" else ""
            raise SimulationError(told + cure, ("variables", name))
    return dict(stated)


def _check_keys(tables: Mapping[str, Any]) -> None:
    """Check that every table and every key of `[simulation]` is one that is read."""
    for name in tables:
        if name not in TABLES:
            raise SimulationError(f"[{name}] is no table of an FMU's SIM.toml; {did_you_mean(name, TABLES)}", (name,))
    check_keys_of_simulation(tables.get("simulation", {}), OF_SIMULATION)


def _stated_flag(table: Mapping[str, Any], name: str) -> bool | None:
    value = table.get(name)
    if not isinstance(value, bool | None):
        raise SimulationError(f"[simulation] {name} must be true or false, not {value!r}", ("simulation", name))
    return value


def _covariates(table: object) -> dict[str, str]:
    if not isinstance(table, dict):
        raise SimulationError(f'[covariates] takes name = "recorded column", not {table!r}', ("covariates",))
    return {str(name): str(column) for name, column in table.items()}


def _check_variable(known: Mapping[str, Any], name: str, path: Path, keys: tuple[str, ...]) -> None:
    if name not in known:
        told = f"[{keys[0]}] {name}: {path.name} has no such variable; {did_you_mean(name, sorted(known))}"
        raise SimulationError(told, keys)


def _parameters(stated: object, known: Mapping[str, Any], path: Path) -> dict[str, Prior]:
    """Return the priors of the FMU's parameters; without a value, the FMU's own start value."""
    if not isinstance(stated, dict):
        told = "[parameters] must be a table of tables: [parameters.NAME] value = …, std = …"
        raise SimulationError(told, ("parameters",))
    priors = {}
    for name, fields in stated.items():
        keys = ("parameters", name)
        _check_variable(known, name, path, keys)
        if not isinstance(fields, dict) or set(fields) - {"value", "std", "unit"}:
            raise SimulationError(f"[parameters.{name}] takes value, std and unit, not {fields!r}", keys)
        value = finite_number(fields.get("value", _start(known[name])), (*keys, "value"))
        std = finite_number(fields.get("std", 0.0), (*keys, "std"))
        priors[name] = Prior(value, std, str(fields.get("unit", known[name].unit or "1")))
    return priors


def _start(variable: Any) -> float | None:  # noqa: ANN401  # FMPy's own type
    """Return a variable's start value, None where it has none that is a number."""
    try:
        return float(variable.start)
    except (TypeError, ValueError):
        return None
