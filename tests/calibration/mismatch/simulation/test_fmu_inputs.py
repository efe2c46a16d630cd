"""Inputs of an FMU between its communication points: a co-simulation and a model exchange, compiled here."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import SensorError, Simulation, compare, library, load_simulation, read_recording
from regolithd.calibration.mismatch.simulation.fmu_inputs import INSTANT
from regolithd.calibration.validation.machine_trials.cases.fmu import build_fmu, compile_fmu

Array = NDArray[np.float64]

FMUS = Path(__file__).parent / "fmus"
INTERFACES = {
    "co-simulation": '<CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true"/>',
    "model exchange": '<ModelExchange modelIdentifier="lag"/>',
}
STEP_S, TAU_S = 0.1, 2.0
LAG = """[simulation]
model = "lag.fmu"

[variables]
u = "command"
x = "reading"

[parameters.tau]
value = 2.0
std = 0.1
"""

SIM = """[simulation]
model = "oven.fmu"

[variables]
heater_voltage = "heater_voltage_V"
T_degC = "oven_temperature_degC"
heater_current = "heater_current_A"

[parameters.heater_ohm]
value = 20.0
std = 0.5
"""


def _needs_compiler() -> None:
    if not shutil.which(os.environ.get("CC", "cc")):
        pytest.skip("no C compiler for the FMU: apt-get install gcc")


def _lag(folder: Path, interface: str, more: str = "") -> Simulation:
    """Return a first-order lag that is an FMU of this interface."""
    _needs_compiler()
    description = (FMUS / "lag.xml.in").read_text().replace("INTERFACE", INTERFACES[interface])
    compile_fmu(FMUS / "lag.c", description.encode(), folder / "lag.fmu")
    (folder / "SIM.toml").write_text(LAG.replace('x = "reading"\n', 'x = "reading"\n' + more))
    return load_simulation(folder / "SIM.toml")


def _motions(rows: int) -> tuple[Array, Array]:
    """Return times and a command that is 0 but for 4 s in each minute."""
    time_s = STEP_S * np.arange(rows)
    phase = time_s % 60 - 50
    return time_s, np.where((phase > 0) & (phase < 4), 3 * np.sin(np.pi * phase / 4) ** 2, 0.0)


def _lagged(command: Array, *, held: bool) -> Array:
    """Return the exact answer to a command that is held from each reading on, or on straight lines between them."""
    found, pieces = np.zeros(len(command)), 1 if held else 20
    keeps = np.exp(-STEP_S / pieces / TAU_S)
    for row in range(len(command) - 1):
        now, rise = found[row], 0.0 if held else command[row + 1] - command[row]
        for piece in range(pieces):
            target = command[row] + rise * (piece + 0.5) / pieces
            now = target + (now - target) * keeps
        found[row + 1] = now
    return found


@pytest.mark.parametrize("interface", INTERFACES)
def test_short_motions_between_rests_are_followed(tmp_path: Path, interface: str) -> None:
    """A solver whose steps grow at rest would pass them, and inputs that are held would come half a step late."""
    simulation = _lag(tmp_path, interface, 'y = "sum"\n')
    time_s, command = _motions(3000)
    inputs = {"t_s": time_s[:, None], "run": np.zeros((len(time_s), 1)), "command": command[:, None]}
    found = simulation.predict(inputs, {"tau": TAU_S})
    lagged = _lagged(command, held=False)
    np.testing.assert_allclose(found["reading"][:, 0], lagged, atol=1e-3 * lagged.max())
    # The output that has the input directly has that of the same instant.
    np.testing.assert_allclose(found["sum"] - found["reading"], inputs["command"], atol=1e-9)


@pytest.mark.parametrize("held", [False, True])
def test_a_machine_that_holds_its_command_is_consistent_as_one_that_does_not(tmp_path: Path, *, held: bool) -> None:
    """A recording does not say what an input does between two readings: that is fitted, and nobody is told of it."""
    simulation = _lag(tmp_path, "co-simulation")
    rng = np.random.default_rng(7)
    time_s = STEP_S * np.arange(2000)
    command = np.convolve(rng.normal(0, 1, 2000), np.ones(20) / 20, "same") * 5
    reading = _lagged(command, held=held) + rng.normal(0, 0.02, 2000)
    table = np.column_stack([time_s, command, reading])
    np.savetxt(tmp_path / "recording.csv", table, delimiter=",", header="t_s,command,reading", comments="")
    answer = compare(read_recording(tmp_path / "recording.csv"), simulation).answer
    assert answer.verdict == "consistent"
    (tau,) = answer.parameters
    assert tau.name == "tau"
    assert tau.low <= TAU_S <= tau.high


@pytest.mark.timeout(300)  # the FMU is stepped through each of its calls: 30 s of computing time
def test_a_command_that_is_late_by_steps_is_no_instant_within_one(tmp_path: Path) -> None:
    """Three steps of delay are out of the bounds of what a recording does not say, and are named."""
    simulation = _lag(tmp_path, "co-simulation")
    rng = np.random.default_rng(6)
    time_s = STEP_S * np.arange(1200)
    command = np.convolve(rng.normal(0, 1, 1200), np.ones(20) / 20, "same") * 5
    reading = np.append(np.zeros(3), _lagged(command, held=False)[:-3]) + rng.normal(0, 0.05, 1200)
    found = compare({"t_s": time_s, "command": command, "reading": reading}, simulation).answer
    assert [effect.name for effect in found.effects] == ["sensor-delay"]
    delay = found.effects[0].parameters["delay_s"]
    assert delay.low <= 3 * STEP_S <= delay.high


def test_a_current_follows_its_voltage_without_a_step_of_delay(tmp_path: Path) -> None:
    """The heater's current is the voltage over the resistance at every row, also where the voltage jumps."""
    _needs_compiler()
    build_fmu("oven", tmp_path / "oven.fmu")
    (tmp_path / "SIM.toml").write_text(SIM)
    simulation = load_simulation(tmp_path / "SIM.toml")
    time_s = 10.0 * np.arange(200)[:, None]
    voltage = np.where(time_s < 900, 0.0, 100.0)
    inputs = {"t_s": time_s, "run": np.zeros_like(time_s), "heater_voltage_V": voltage}
    found = simulation.predict(inputs, {"heater_ohm": 20.0, INSTANT: 0.0})
    np.testing.assert_allclose(found["heater_current_A"], voltage / 20, atol=1e-9)
    warm = found["oven_temperature_degC"]
    assert warm[90, 0] == pytest.approx(20.0)
    assert warm[91, 0] > 20.5


def test_errors_of_inputs_and_effects_to_leave_out_stand_in_the_file(tmp_path: Path) -> None:
    """As for a class."""
    _needs_compiler()
    build_fmu("oven", tmp_path / "oven.fmu")
    text = SIM.replace('"oven.fmu"', '"oven.fmu"\nwithout_effects = ["slip-sinkage"]', 1)
    (tmp_path / "SIM.toml").write_text(f"{text}\n[sensors]\nheater_voltage_relative_std = 0.01\n")
    simulation = load_simulation(tmp_path / "SIM.toml")
    assert simulation.sensors == {"heater_voltage_V": SensorError(relative=0.01)}
    assert {each.name for each in library()} - {each.name for each in simulation.candidates(library())} == {
        "slip-sinkage"
    }
