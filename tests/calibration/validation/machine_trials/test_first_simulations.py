"""What a user hands over: short, complete, and the same physics as the true machine before anything is concealed."""

from __future__ import annotations

import ctypes
import importlib.util
import sys
import tomllib
import types
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from regolithd.calibration.validation.machine_trials.batch import write_case
from regolithd.calibration.validation.machine_trials.cases.files import write_simulation
from regolithd.calibration.validation.machine_trials.cases.generator import make_case
from regolithd.calibration.validation.machine_trials.cases.plan import plan_case
from regolithd.calibration.validation.machine_trials.machines import MACHINES
from regolithd.calibration.validation.machine_trials.physics.machine import Machine, Schedule, Units, World

if TYPE_CHECKING:
    from pathlib import Path

CLASSES = [machine for machine in MACHINES.values() if machine.name != "oven"]


@pytest.fixture
def contract(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand for the contract's import: a simulation without behaviour, and a prior that keeps what it is told."""
    stub = types.ModuleType("regolithd.calibration.mismatch")
    vars(stub).update(Simulation=type("Simulation", (), {}), Prior=lambda *told: told)
    monkeypatch.setitem(sys.modules, stub.__name__, stub)


def loaded(machine: Machine, units: Units, folder: Path) -> tuple[Any, dict[str, Any]]:
    """Return the user's simulation and the tables of SIM.toml."""
    toml, source = write_simulation(machine, units, folder)
    tables = tomllib.loads(toml.read_text())
    module_name, class_name = tables["simulation"]["model"].split(":")
    spec = importlib.util.spec_from_file_location(module_name, source)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, class_name)(), tables


def world_of(machine: Machine, schedule: Schedule | None = None) -> World:
    """Return a machine on a short drive, its parameters a deviation away from what is stated."""
    times = schedule or (Schedule(1, 3000) if machine.name == "two-tanks" else Schedule(50, 60))
    values = {name: known.value + known.std for name, known in machine.parameters.items()}
    return World(machine, machine.drive(np.random.default_rng(8), times), values)


def inputs_of(world: World, units: Units) -> dict[str, np.ndarray]:
    """Return what a simulation is given: each column in the units of the recording."""
    columns = {name: units.converted(name, values) for name, values in world.drive.columns.items()}
    time = units.converted("t_s", world.drive.t_s)[:, None] * np.ones_like(world.drive.compared)
    return {units.renamed("t_s"): time, **{units.renamed(name): values for name, values in columns.items()}}


@pytest.mark.usefixtures("contract")
@pytest.mark.parametrize("which", ["base_units", "other_units"])
@pytest.mark.parametrize("machine", CLASSES, ids=lambda machine: machine.name)
def test_a_class_predicts_what_the_true_machine_does(machine: Machine, which: str, tmp_path: Path) -> None:
    """With the true parameters, each class agrees with its machine within 2 % of the mean, in either units."""
    units = getattr(machine, which)
    simulation, _ = loaded(machine, units, tmp_path)
    world = world_of(machine)
    predicted = simulation.predict(inputs_of(world, units), world.values)
    for channel, base in world.base.items():
        found = predicted[units.renamed(channel)] if isinstance(predicted, dict) else predicted
        rows = world.drive.compared
        assert np.array_equal(np.isfinite(found), rows)
        wanted = units.converted(channel, base)
        assert np.max(np.abs(found[rows] - wanted[rows])) < 0.02 * np.mean(np.abs(wanted[rows]))


@pytest.mark.usefixtures("contract")
def test_the_tanks_begin_empty_in_every_run_whether_time_goes_on_or_begins_again(tmp_path: Path) -> None:
    """The same two runs give the same weights with one clock for both and with a clock that begins again."""
    tanks = MACHINES["two-tanks"]
    simulation, _ = loaded(tanks, tanks.base_units, tmp_path)
    world = world_of(tanks)
    given = inputs_of(world, tanks.base_units)
    assert world.drive.run is not None
    second = world.drive.run == 2
    restarted = {**given, "t_s": given["t_s"] - np.where(second, world.drive.t_s[second][0], 0.0)[:, None]}
    first = simulation.predict(given, world.values)
    np.testing.assert_allclose(simulation.predict(restarted, world.values), first)
    assert not first[second][0].any()


@pytest.mark.usefixtures("contract")
@pytest.mark.parametrize("machine", CLASSES, ids=lambda machine: machine.name)
def test_a_class_is_short_and_its_tables_agree_with_it(machine: Machine, tmp_path: Path) -> None:
    """Under 60 lines; channels, priors and covariates as the recording and SIM.toml have them."""
    simulation, tables = loaded(machine, machine.base_units, tmp_path)
    (source,) = tmp_path.glob("*.py")
    assert len(source.read_text().splitlines()) < 60
    channels = getattr(simulation, "channels", None) or {simulation.channel: simulation.unit}
    assert channels == machine.channels
    assert simulation.parameters == {n: (k.value, k.std, k.unit) for n, k in machine.parameters.items()}
    assert tables["parameters"] == {n: {"value": k.value, "std": k.std} for n, k in machine.parameters.items()}
    given = inputs_of(world_of(machine), machine.base_units)
    assert set(simulation.inputs) <= set(given)
    assert "time" in simulation.covariates(given)


def test_the_fmu_holds_a_description_and_a_library_that_works(tmp_path: Path) -> None:
    """Compiled from C, stepped through the FMI functions, the oven agrees with the true one to nine digits."""
    oven = MACHINES["oven"]
    toml, path = write_simulation(oven, oven.base_units, tmp_path)
    tables = tomllib.loads(toml.read_text())
    assert tables["simulation"]["model"] == path.name
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
        assert "modelDescription.xml" in archive.namelist()
    (library,) = (tmp_path / "binaries").rglob("oven.*")
    world = world_of(oven, Schedule(1, 900))
    np.testing.assert_allclose(stepped(library, world), world.base["oven_temperature_degC"][:, 0], rtol=1e-9)


def stepped(library: Path, world: World) -> np.ndarray:
    """Return the temperature [°C] that the FMU's functions give, inputs set before each step."""
    functions = ctypes.CDLL(str(library))
    functions.fmi2Instantiate.restype = ctypes.c_void_p
    unit = ctypes.c_void_p(functions.fmi2Instantiate(b"oven", 1, b"", None, None, 0, 0))

    def exchange(name: str, reference: int, value: float = 0.0) -> float:
        given = ctypes.c_double(value)
        at = ctypes.c_uint(reference)
        assert getattr(functions, name)(unit, ctypes.byref(at), ctypes.c_size_t(1), ctypes.byref(given)) == 0
        return given.value

    for reference, key in ((5, "heat_capacity_J_K"), (6, "loss_W_K"), (7, "heater_ohm")):
        exchange("fmi2SetReal", reference, world.values[key])
    celsius = np.zeros(len(world.drive.t_s))
    for row, t_s in enumerate(world.drive.t_s):
        celsius[row] = exchange("fmi2GetReal", 2)
        assert exchange("fmi2GetReal", 3) == pytest.approx(celsius[row] + 273.15)
        exchange("fmi2SetReal", 0, world.drive.columns["heater_voltage_V"][row, 0])
        exchange("fmi2SetReal", 1, world.drive.columns["ambient_temperature_degC"][row, 0])
        assert functions.fmi2DoStep(unit, ctypes.c_double(t_s), ctypes.c_double(1.0), 0) == 0
    functions.fmi2FreeInstance(unit)
    return celsius


def test_fmpy_reads_the_fmu(tmp_path: Path) -> None:
    """FMPy finds the archive valid, and simulates it to the temperature of the true oven."""
    fmpy = pytest.importorskip("fmpy")
    oven = MACHINES["oven"]
    _, path = write_simulation(oven, oven.base_units, tmp_path)
    world = world_of(oven, Schedule(1, 600))
    given = np.zeros(600, dtype=[("time", float), ("heater_voltage", float), ("ambient", float)])
    given["time"] = world.drive.t_s
    given["heater_voltage"] = world.drive.columns["heater_voltage_V"][:, 0]
    given["ambient"] = world.drive.columns["ambient_temperature_degC"][:, 0]
    assert {v.name for v in fmpy.read_model_description(str(path)).modelVariables} >= set(world.values)
    found = fmpy.simulate_fmu(
        str(path), stop_time=599, step_size=1, output_interval=1, input=given, start_values=dict(world.values)
    )
    true = world.base["oven_temperature_degC"][:, 0]
    assert np.max(np.abs(found["T_degC"] - true)) < 0.02 * np.mean(true)


@pytest.mark.parametrize("machine", list(MACHINES.values()), ids=lambda machine: machine.name)
def test_a_solver_s_folder_holds_three_files(machine: Machine, tmp_path: Path) -> None:
    """Recording, SIM.toml and the simulation that it names: nothing that tells what is concealed."""
    case = make_case(plan_case(0, 5, machine.name, "nothing", 0))
    write_case(case, tmp_path)
    module = machine.name.replace("-", "_")
    source = f"{module}.fmu" if machine.name == "oven" else f"{module}.py"
    files = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert files == sorted(["0/SIM.toml", "0/recording.csv.gz", f"0/{source}"])
