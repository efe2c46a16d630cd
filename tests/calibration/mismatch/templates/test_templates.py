"""What `--init` writes can be used at once, and nothing of the user's is overwritten."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.mismatch.templates import FILES, write_templates

if TYPE_CHECKING:
    from pathlib import Path


def test_the_class_finds_friction_in_a_recording(tmp_path: Path) -> None:
    """The files as they are written load, and name the Coulomb friction of a joint."""
    write_templates("class", tmp_path)
    simulation = load_simulation(tomllib.loads((tmp_path / "SIM.toml").read_text()), beside=tmp_path)
    time_s = 0.02 * np.arange(6000)
    speed = np.sin(0.7 * time_s) + 0.6 * np.sin(1.9 * time_s)
    acceleration = np.gradient(speed, 0.02)
    noise = np.random.default_rng(1).normal(0, 0.05, len(time_s))
    torque = 0.5 * acceleration + 0.2 * speed + 0.1 * np.sign(speed) + noise
    columns = {"t_s": time_s, "torque_Nm": torque, "acceleration_rad_s2": acceleration, "speed_rad_s": speed}
    assert [effect.name for effect in compare(from_columns(columns), simulation).answer.effects] == ["coulomb-friction"]


def test_the_rover_wheel_loads(tmp_path: Path) -> None:
    """Every key of the template is one of the built-in simulation's."""
    write_templates("rover-wheel", tmp_path / "new")
    simulation = load_simulation(tomllib.loads((tmp_path / "new" / "SIM.toml").read_text()))
    assert simulation.parameters["cohesion_Pa"].std == pytest.approx(0.03 * 3150)


def test_an_fmu_that_is_not_there_is_one_message(tmp_path: Path) -> None:
    """The template names a file that the user has to bring."""
    write_templates("fmu", tmp_path)
    with pytest.raises(SimulationError, match=r"machine\.fmu"):
        load_simulation(tomllib.loads((tmp_path / "SIM.toml").read_text()), beside=tmp_path)


@pytest.mark.parametrize("kind", FILES)
def test_nothing_is_overwritten(kind: str, tmp_path: Path) -> None:
    """A second call says which file is there."""
    write_templates(kind, tmp_path)
    with pytest.raises(SimulationError, match=r"SIM\.toml exists already"):
        write_templates(kind, tmp_path)


def test_an_unknown_kind_is_told_with_those_that_there_are(tmp_path: Path) -> None:
    """The message lists what may be asked for."""
    with pytest.raises(SimulationError, match="rover-wheel, class, fmu"):
        write_templates("matlab", tmp_path)
