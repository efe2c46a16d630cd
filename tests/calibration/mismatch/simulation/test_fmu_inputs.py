"""An output of an FMU that depends on an input directly has the input of the same instant."""

from __future__ import annotations

import os
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.mismatch import SensorError, library, load_simulation
from regolithd.calibration.validation.machine_trials.cases.fmu import build_fmu

if TYPE_CHECKING:
    from pathlib import Path

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


def test_a_current_follows_its_voltage_without_a_step_of_delay(tmp_path: Path) -> None:
    """The heater's current is the voltage over the resistance at every row, also where the voltage jumps."""
    if not shutil.which(os.environ.get("CC", "cc")):
        pytest.skip("no C compiler for the FMU: apt-get install gcc")
    build_fmu("oven", tmp_path / "oven.fmu")
    (tmp_path / "SIM.toml").write_text(SIM)
    simulation = load_simulation(tmp_path / "SIM.toml")
    time_s = 10.0 * np.arange(200)[:, None]
    voltage = np.where(time_s < 900, 0.0, 100.0)
    inputs = {"t_s": time_s, "run": np.zeros_like(time_s), "heater_voltage_V": voltage}
    found = simulation.predict(inputs, {"heater_ohm": 20.0})
    np.testing.assert_allclose(found["heater_current_A"], voltage / 20, atol=1e-9)
    warm = found["oven_temperature_degC"]
    assert warm[90, 0] == pytest.approx(20.0)
    assert warm[91, 0] > 20.5


def test_errors_of_inputs_and_effects_to_leave_out_stand_in_the_file(tmp_path: Path) -> None:
    """As for a class."""
    if not shutil.which(os.environ.get("CC", "cc")):
        pytest.skip("no C compiler for the FMU: apt-get install gcc")
    build_fmu("oven", tmp_path / "oven.fmu")
    text = SIM.replace('"oven.fmu"', '"oven.fmu"\nwithout_effects = ["slip-sinkage"]', 1)
    (tmp_path / "SIM.toml").write_text(f"{text}\n[sensors]\nheater_voltage_relative_std = 0.01\n")
    simulation = load_simulation(tmp_path / "SIM.toml")
    assert simulation.sensors == {"heater_voltage_V": SensorError(relative=0.01)}
    assert {each.name for each in library()} - {each.name for each in simulation.candidates(library())} == {
        "slip-sinkage"
    }
