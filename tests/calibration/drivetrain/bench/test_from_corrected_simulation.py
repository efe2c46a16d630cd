"""The drivetrain of a corrected simulation is copied to `rover.toml`, and nothing else of the simulation."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.drivetrain.bench.from_corrected_simulation import copy_drivetrain
from regolithd.calibration.drivetrain.bench.line_fit import BenchError
from regolithd.calibration.drivetrain.torque import motor_current, no_load_current
from regolithd.calibration.parameters import Drivetrain

ROVER = """\
[slip]
standstill_rad_s = 0.05

[drivetrain]      # as it left the workshop
no_load_current_A = 0.037     # wheels-up
gain_factor = 1.0
"""


def _files(tmp_path: Path, simulation: str) -> tuple[Path, Path]:
    (tmp_path / "NEW.toml").write_text(simulation)
    (tmp_path / "rover.toml").write_text(ROVER)
    return tmp_path / "NEW.toml", tmp_path / "rover.toml"


def test_friction_and_gain_are_copied_with_their_standard_deviations(tmp_path: Path) -> None:
    """Values that differ are written; comments and equal values stay."""
    corrected = """\
[drivetrain]
no_load_current_A = [0.037, 0.037, 0.052, 0.037, 0.037, 0.037]
no_load_current_std_A = 0.001
gain_relative_std = 0.03
"""
    update = copy_drivetrain(*_files(tmp_path, corrected))
    found = tomllib.loads(update.text)["drivetrain"]
    assert found["no_load_current_A"] == [0.037, 0.037, 0.052, 0.037, 0.037, 0.037]
    assert found["no_load_current_std_A"] == 0.001
    assert found["gain_relative_std"] == 0.03
    assert "# wheels-up" in update.text
    assert "# as it left the workshop" in update.text
    assert Drivetrain(**found).gain_factor == (1.0,) * 6


def test_viscous_friction_of_another_power_becomes_the_nearest_line(tmp_path: Path) -> None:
    """Over the rover's range of speeds the linear no-load current is within 1.5 mA of the simulation's power law."""
    corrected = """\
[drivetrain]
no_load_current_A = 0.037
[[effects]]
name = "viscous-friction"
shape = { power = 1.2 }
coefficients = [0.05]
wheels = [1, 2, 3, 4, 5, 6]
relative_std = 0.1
[[effects]]
name = "grade-resistance"
shape = { }
coefficients = [0.2]
wheels = [1, 2, 3, 4, 5, 6]
"""
    update = copy_drivetrain(*_files(tmp_path, corrected))
    found = Drivetrain(**tomllib.loads(update.text)["drivetrain"])
    for speed in (0.05, 0.2, 0.4, 0.66):
        drag = no_load_current([speed * 1400] * 6, found)
        assert drag == pytest.approx([0.037 + 0.05 * speed**1.2] * 6, abs=0.0015)
    assert found.viscous_current_std_A_s_per_rad[0] == pytest.approx(0.1 * found.viscous_current_A_s_per_rad[0])
    assert any("grade-resistance stays" in said for said in update.messages)


def test_a_loss_independent_of_torque_becomes_gain_and_no_load_current(tmp_path: Path) -> None:
    """A loss of a tenth at two wheels goes into gain and no-load current; one of power 1 stays in the simulation."""
    corrected = """\
[drivetrain]
no_load_current_A = 0.037
[[effects]]
name = "load-dependent-efficiency"
shape = { power = 0.0 }
coefficients = [0.1]
wheels = [1, 2]
relative_std = 0.2
[[effects]]
name = "load-dependent-efficiency"
shape = { power = 1.0 }
coefficients = [0.1]
wheels = [3]
"""
    update = copy_drivetrain(*_files(tmp_path, corrected))
    found = Drivetrain(**tomllib.loads(update.text)["drivetrain"])
    torque, speed = np.full(6, 0.5), np.full(6, 400.0)
    before = Drivetrain(no_load_current_A=0.037)  # type: ignore[arg-type]  # one value for six wheels
    ratio = motor_current(torque, speed, found) / motor_current(torque, speed, before)
    assert ratio == pytest.approx([1.1, 1.1, 1, 1, 1, 1], rel=1e-5)
    assert found.gain_factor_std[0] == pytest.approx(0.2 * 0.1 / 1.1**2, rel=1e-4)
    assert any("load-dependent-efficiency stays" in said for said in update.messages)


def test_another_drivetrain_is_refused(tmp_path: Path) -> None:
    """Other constants of Eq. 11, or no drivetrain at all, are an error that names them."""
    with pytest.raises(BenchError, match="planetary_ratio"):
        copy_drivetrain(*_files(tmp_path, "[drivetrain]\nplanetary_ratio = 19.0\n"))
    with pytest.raises(BenchError, match="no simulation of this rover"):
        copy_drivetrain(*_files(tmp_path, "[axis]\ngain = 1.0\n"))


def test_an_equal_drivetrain_changes_nothing(tmp_path: Path) -> None:
    """An equal drivetrain leaves the text unchanged to the byte, with a message."""
    update = copy_drivetrain(*_files(tmp_path, "[drivetrain]\nno_load_current_A = 0.037\n"))
    assert update.text == ROVER
    assert "nothing to write" in update.messages[0]
