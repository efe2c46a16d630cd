"""What SIM.toml says of an FMU, and how FMPy is called; the test is FMPy."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import Prior, SensorError
from regolithd.calibration.mismatch.simulation import fmu
from regolithd.calibration.mismatch.simulation.fmu import FmuSimulation
from regolithd.calibration.mismatch.simulation.fmu_inputs import ANY_INSTANT, INSTANT, follow_inputs

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def variable(name: str, causality: str, unit: str | None, start: str | None = None, reference: int = 0) -> Any:
    """Return a variable as FMPy describes it."""
    kind = {"type": "Real", "variability": "continuous", "dimensions": []}
    return SimpleNamespace(name=name, causality=causality, unit=unit, start=start, valueReference=reference, **kind)


VARIABLES = [
    variable("voltage", "input", "V", reference=7),
    variable("level", "output", "m", reference=8),
    variable("flow", "output", None, reference=9),
    variable("area", "parameter", "m2", start="0.5"),
    variable("label", "parameter", None, start="tank"),
    variable("pressure", "local", "Pa", reference=10),
]
TABLES: dict[str, Any] = {
    "simulation": {"model": "tank.fmu"},
    "variables": {"voltage": "pump_V", "level": "level_m"},
    "covariates": {"wheel_speed": "pump_rad_s"},
    "parameters": {"area": {"std": 0.01}},
}


class Tank:
    """FMPy for one tank: its level is the integral of voltage over area; every call is kept."""

    def __init__(self) -> None:
        self.calls: list[dict[str, Any]] = []
        self.unpacked: list[tuple[str, str]] = []
        self.error: Exception | None = None
        self.freed = 0

    def read_model_description(self, path: str) -> Any:
        """Describe it."""
        if "damaged" in path:
            raise RuntimeError("no modelDescription.xml")
        return SimpleNamespace(modelVariables=VARIABLES)

    def extract(self, path: str, folder: str) -> None:
        """Note it."""
        self.unpacked.append((path, folder))

    def instantiate_fmu(self, _folder: str, _description: object) -> Any:
        """Return a slave, which is not stepped here."""
        return SimpleNamespace(doStep=None, setReal=None, freeInstance=self._free)

    def _free(self) -> None:
        self.freed += 1

    def simulate_fmu(self, folder: str, **options: Any) -> dict[str, Array]:
        """Integrate by Euler's method at the output interval."""
        self.calls.append({"folder": folder, **options})
        if self.error:
            raise self.error
        count = round((options["stop_time"] - options["start_time"]) / options["output_interval"]) + 1
        time = options["start_time"] + options["output_interval"] * np.arange(count)
        signal = options["input"]
        voltage = np.ones(count) if signal is None else np.interp(time, signal["time"], signal["voltage"])
        rate = voltage / options["start_values"].get("area", 1.0)
        level = np.concatenate(([0.0], np.cumsum(rate[:-1]))) * options["output_interval"]
        return {"time": time, "level": level, "flow": 2 * rate}


@pytest.fixture
def tank(monkeypatch: pytest.MonkeyPatch) -> Tank:
    """FMPy, which has one model."""
    made = Tank()
    monkeypatch.setattr(fmu, "_fmpy", lambda: made)
    return made


def loaded(tmp_path: Path, **tables: Any) -> FmuSimulation:
    """Return the tank with some tables replaced."""
    (tmp_path / "tank.fmu").touch()
    return FmuSimulation.from_file(tmp_path / "tank.fmu", {**TABLES, **tables})


def inputs(rows: int = 6, wheels: int = 1, start_s: float = 0.0, **columns: Array) -> dict[str, Array]:
    """Return readings of one run every half second."""
    time_s = start_s + 0.5 * np.arange(rows)[:, None] * np.ones(wheels)
    return {"t_s": time_s, "run": np.zeros_like(time_s), "pump_V": np.ones_like(time_s), **columns}


@pytest.mark.usefixtures("tank")
def test_the_fmu_says_which_variables_are_inputs_and_outputs(tmp_path: Path) -> None:
    """Names are those of the recorded columns, units the FMU's, a value that is not stated its own start value."""
    found = loaded(tmp_path)
    assert (found.channel, found.unit, found.channels, found.inputs) == ("level_m", "m", {}, ("pump_V",))
    assert found.parameters == {"area": Prior(0.5, 0.01, "m2"), INSTANT: ANY_INSTANT}
    assert (found.wheel_column, found.one_way) == ("wheel", None)
    pump = {"model": "tank.fmu", "one_way": True}
    assert loaded(tmp_path, simulation=pump).one_way
    with pytest.raises(SimulationError, match=r"\[simulation\] one_way must be true or false, not 'yes'"):
        loaded(tmp_path, simulation=pump | {"one_way": "yes"})
    assert loaded(tmp_path, variables={"voltage": "pump_V", "pressure": "p_Pa"}).channel == "p_Pa"
    several = {"voltage": "pump_V", "flow": "flow", "level": "level_m"}
    found = loaded(tmp_path, variables=several, simulation={"model": "tank.fmu", "wheel_column": "tank"})
    assert (found.channels, found.wheel_column) == ({"flow": "1", "level_m": "m"}, "tank")
    stated = {"area": {"value": 2, "unit": "ha"}}
    assert loaded(tmp_path, parameters=stated).parameters["area"] == Prior(2.0, 0.0, "ha")


@pytest.mark.usefixtures("tank")
def test_an_fmu_has_errors_of_inputs_as_a_class_has(tmp_path: Path) -> None:
    """`[sensors]`, by the columns' names."""
    assert loaded(tmp_path, sensors={"pump_std_V": 0.1}).sensors == {"pump_V": SensorError(absolute=0.1)}


@pytest.mark.usefixtures("tank")
def test_a_table_or_key_that_is_not_read_is_an_error(tmp_path: Path) -> None:
    """A misspelt table would be left out without a word."""
    with pytest.raises(SimulationError, match=r"\[parameter\] is no table .*; did you mean parameters\?"):
        loaded(tmp_path, parameter={"area": {"value": 1.0}})
    with pytest.raises(SimulationError, match=r"\[simulation\] has no key oneway; did you mean one_way\?"):
        loaded(tmp_path, simulation={"model": "tank.fmu", "oneway": True})


def test_the_fmu_is_unpacked_once_and_its_folder_goes_with_it(tank: Tank, tmp_path: Path) -> None:
    """A comparison runs it hundreds of times."""
    simulation = loaded(tmp_path)
    ((path, folder),) = tank.unpacked
    assert path == str(tmp_path / "tank.fmu")
    for area in (0.5, 1.0):
        simulation.predict(inputs(), {"area": area})
    assert [call["folder"] for call in tank.calls] == [folder] * 2


def test_a_run_is_simulated_from_its_first_instant_with_its_own_input(tank: Tank, tmp_path: Path) -> None:
    """Each run and each wheel by itself, at the usual step of its readings."""
    drive = inputs(wheels=2, start_s=10.0)
    drive["run"][3:] = 1.0
    drive["pump_V"][:, 1] = 2.0
    found = loaded(tmp_path).predict(drive, {"area": 0.5})
    np.testing.assert_allclose(found, np.array([0.0, 1, 2, 0, 1, 2])[:, None] * [1, 2])
    assert [(call["start_time"], call["stop_time"]) for call in tank.calls] == [(10.0, 11.0), (11.5, 12.5)] * 2
    assert {call["output_interval"] for call in tank.calls} == {0.5}
    assert [call["start_values"] for call in tank.calls] == [{"area": 0.5}] * 4
    assert [call["output"] for call in tank.calls] == [["level"]] * 4
    assert tank.calls[0]["model_description"].modelVariables is VARIABLES
    np.testing.assert_array_equal(tank.calls[2]["input"]["time"], [10.0, 10.5, 11.0])
    np.testing.assert_array_equal(tank.calls[2]["input"]["voltage"], [2.0, 2.0, 2.0])


@pytest.mark.usefixtures("tank")
def test_several_outputs_are_returned_by_column(tmp_path: Path) -> None:
    """As `channels` of a class would be."""
    variables = {"voltage": "pump_V", "flow": "flow_m3_s", "level": "level_m"}
    found: Any = loaded(tmp_path, variables=variables).predict(inputs(), {"area": 0.5})
    np.testing.assert_allclose(found["flow_m3_s"], np.full((6, 1), 4.0))
    np.testing.assert_allclose(found["level_m"][:, 0], np.arange(6.0))


def test_an_input_that_was_not_measured_is_bridged_by_the_fmu(tank: Tank, tmp_path: Path) -> None:
    """Rows without it are left out of the signal; with fewer than two the prediction is unknown, and nothing runs."""
    drive = inputs()
    drive["pump_V"][2] = np.nan
    simulation = loaded(tmp_path)
    simulation.predict(drive, {"area": 0.5})
    assert tank.calls[0]["input"]["time"].tolist() == [0.0, 0.5, 1.5, 2.0, 2.5]
    drive["pump_V"][1:] = np.nan
    assert np.isnan(simulation.predict(drive, {"area": 0.5})).all()
    assert len(tank.calls) == 1
    drive["pump_V"][1] = 3.0
    assert np.isfinite(simulation.predict(drive, {"area": 0.5})).all()


def test_an_fmu_without_inputs_runs_by_time_alone(tank: Tank, tmp_path: Path) -> None:
    """No signal is handed over."""
    simulation = loaded(tmp_path, variables={"level": "level_m"})
    np.testing.assert_allclose(simulation.predict(inputs(), {"area": 1.0})[:, 0], 0.5 * np.arange(6))
    assert tank.calls[0]["input"] is None
    assert INSTANT not in simulation.parameters


def test_the_same_run_is_simulated_once(tank: Tank, tmp_path: Path) -> None:
    """The last 64 results are kept, by time, input and parameters."""
    simulation = loaded(tmp_path)
    for _ in range(3):
        simulation.predict(inputs(), {"area": 0.5})
    assert len(tank.calls) == 1
    simulation.predict(inputs(start_s=1.0), {"area": 0.5})
    simulation.predict(inputs(pump_V=2 * np.ones((6, 1))), {"area": 0.5})
    assert len(tank.calls) == 3
    for area in range(1, 62):
        simulation.predict(inputs(), {"area": float(area)})
    assert len(tank.calls) == 64
    simulation.predict(inputs(), {"area": 0.5})
    assert len(tank.calls) == 64
    simulation.predict(inputs(), {"area": 99.0})
    simulation.predict(inputs(start_s=1.0), {"area": 0.5})
    assert len(tank.calls) == 65
    simulation.predict(inputs(), {"area": 0.5})
    assert len(tank.calls) == 66


def test_a_run_that_fails_is_one_message(tank: Tank, tmp_path: Path) -> None:
    """With FMPy's own words."""
    tank.error = RuntimeError("fmi2DoStep returned 3")
    with pytest.raises(SimulationError, match=r"^the FMU could not be simulated: fmi2DoStep returned 3$"):
        loaded(tmp_path).predict(inputs(), {"area": 0.5})
    assert tank.freed == 1


@pytest.mark.parametrize(("kind", "setter"), [("Real", "setReal"), ("Float64", "setFloat64")])
def test_a_step_has_the_inputs_of_its_instant_and_its_outputs_those_of_its_end(kind: str, setter: str) -> None:
    """FMI 2 and 3 name the function differently; a discrete input is held during the step."""
    put: list[tuple[list[int], list[float]]] = []
    steps: list[tuple[float, float]] = []

    def step(*, currentCommunicationPoint: float, communicationStepSize: float) -> str:  # FMPy's names
        steps.append((currentCommunicationPoint, communicationStepSize))
        return "done"

    fmu = SimpleNamespace(doStep=step, **{setter: lambda references, values: put.append((references, values))})
    common = {"type": kind, "dimensions": []}
    variables = {
        "voltage": SimpleNamespace(name="voltage", valueReference=7, variability="continuous", **common),
        "valve": SimpleNamespace(name="valve", valueReference=8, variability="discrete", **common),
    }
    signal = np.zeros(3, [("time", np.float64), ("voltage", np.float64), ("valve", np.float64)])
    signal["time"], signal["voltage"], signal["valve"] = [0.0, 1.0, 2.0], [0.0, 10.0, 30.0], [0.0, 1.0, 1.0]
    follow_inputs(fmu, variables, signal, 0.25)
    assert fmu.doStep(currentCommunicationPoint=1.0, communicationStepSize=0.5) == "done"
    assert steps == [(1.0, 0.5)]
    assert put == [([7], [12.5]), ([7, 8], [20.0, 1.0])]


@pytest.mark.usefixtures("tank")
def test_covariates_are_named_or_inputs(tmp_path: Path) -> None:
    """An input that `[covariates]` names has that name alone; one that was not recorded is left out."""
    simulation = loaded(tmp_path)
    speed = np.full((6, 1), 3.0)
    found = simulation.covariates(inputs(pump_rad_s=speed))
    assert set(found) == {"time", "pump_V", "wheel_speed"}
    assert found["wheel_speed"] is speed
    assert set(simulation.covariates(inputs())) == {"time", "pump_V"}
    assert set(loaded(tmp_path, covariates={"torque": "pump_V"}).covariates(inputs())) == {"time", "torque"}


@pytest.mark.usefixtures("tank")
def test_corrected_tables_have_the_values_of_the_recording(tmp_path: Path) -> None:
    """What else was stated stays."""
    stated = {"area": {"value": 0.4, "std": 0.01, "unit": "m2"}}
    found = loaded(tmp_path, parameters=stated).corrected_tables({"area": 0.45, "own": 1.0})
    assert found == {"parameters": {"area": {"value": 0.45, "std": 0.01, "unit": "m2"}}}


@pytest.mark.parametrize(
    ("tables", "told", "keys"),
    [
        ({"variables": {}}, r"^an FMU needs \[variables\]", ("variables",)),
        ({"variables": "level"}, r"^an FMU needs \[variables\]", ("variables",)),
        ({"variables": {"voltage": "pump_V"}}, r"maps no output of tank\.fmu", ()),
        (
            {"variables": {"leve": "level_m"}},
            r"^\[variables\] leve: tank\.fmu has no such variable; did you mean level\?",
            ("variables", "leve"),
        ),
        (
            {"variables": {"area": "area_m2"}},
            r"area is neither input nor output .*, but of the kind parameter; state it as \[parameters\.area\]",
            ("variables", "area"),
        ),
        ({"variables": {"level": 3}}, r"level: the name of a recorded column .* not 3", ("variables", "level")),
        ({"covariates": ["time"]}, r"^\[covariates\] takes name = \"recorded column\"", ("covariates",)),
        ({"parameters": [1]}, r"^\[parameters\] must be a table of tables", ("parameters",)),
        ({"parameters": {"aera": {}}}, r"^\[parameters\] aera: .* did you mean area\?", ("parameters", "aera")),
        ({"parameters": {"area": 0.5}}, r"area\] takes value, std and unit, not 0\.5", ("parameters", "area")),
        ({"parameters": {"area": {"mean": 1}}}, r"^\[parameters\.area\] takes value", ("parameters", "area")),
        ({"parameters": {"area": {"std": "big"}}}, "not 'big'", ("parameters", "area", "std")),
        ({"parameters": {"label": {"std": 1.0}}}, "not None", ("parameters", "label", "value")),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("tank")
def test_a_mistake_is_one_message_with_its_key(
    tables: dict[str, Any], told: str, keys: tuple[str, ...], tmp_path: Path
) -> None:
    """The reader of the file adds the line."""
    with pytest.raises(SimulationError, match=told) as caught:
        loaded(tmp_path, **tables)
    assert caught.value.keys == keys


@pytest.mark.usefixtures("tank")
def test_a_file_that_is_no_fmu_is_told(tmp_path: Path) -> None:
    """With FMPy's own words."""
    (tmp_path / "damaged.fmu").touch()
    with pytest.raises(SimulationError, match=r"damaged\.fmu is not an FMU that can be read: no modelDescription\.xml"):
        FmuSimulation.from_file(tmp_path / "damaged.fmu", TABLES)


@pytest.mark.usefixtures("tank")
def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    """With what says where it is."""
    with pytest.raises(SimulationError, match=r"there is no file .*lost\.fmu; \[simulation\] path says"):
        FmuSimulation.from_file(tmp_path / "lost.fmu", TABLES)


def test_fmpy_is_needed_for_an_fmu_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The message has the command that installs it."""
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(SimulationError, match=r"pip install 'regolithd\[fmu\]'"):
        loaded(tmp_path)
