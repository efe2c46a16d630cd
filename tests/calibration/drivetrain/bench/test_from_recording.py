"""`regolithd calibrate`: instructions, the fit of a recording, its figure, and the update of `rover.toml`."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from regolithd.calibration.drivetrain.torque import motor_current, wheel_torque
from regolithd.calibration.parameters import Drivetrain, LoadCells
from regolithd.daemon.cli import app
from regolithd.daemon.config.configuration import Configuration, Smoothing
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Pipeline
from regolithd.daemon.pipeline.snapshot import QUANTITIES, ROW, Snapshot
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED

ROOT = Path(__file__).resolve().parents[4]


def calibrate(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command."""
    command = [sys.executable, "-m", "regolithd", "calibrate", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)


@pytest.fixture
def spin(tmp_path: Path) -> Path:
    """Write a wheels-up recording: 30 + k mA for wheel k, and 20 µA s/rad."""
    rng = np.random.default_rng(0)
    lines = ["t_s,wheel,motor_current_A,motor_speed_rad_s,load_N"]
    levels = np.repeat([80.0, 200.0, 320.0, -80.0, -200.0, -320.0], 30)
    for k, speed in enumerate(levels):
        for wheel in range(1, 7):
            current = np.sign(speed) * (0.030 + 0.001 * wheel) + 2e-5 * speed + rng.normal(0, 0.001)
            lines.append(f"{k / 2},{wheel},{current:.6f},{speed},0.0")
    path = tmp_path / "spin.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_spin_updates_the_no_load_current(tmp_path: Path, spin: Path) -> None:
    """`rover.toml` has the values of each wheel with their standard deviations, and is a valid configuration."""
    config, plot = tmp_path / "rover.toml", tmp_path / "spin.png"
    shutil.copy(ROOT / "rover.toml", config)
    done = calibrate("wheels-up", spin, "--config", config, "--plot", plot)
    assert done.returncode == 0, done.stderr
    assert plot.stat().st_size > 10_000
    drivetrain = Configuration(**tomllib.loads(config.read_text())).drivetrain
    np.testing.assert_allclose(drivetrain.no_load_current_A, 0.030 + 0.001 * np.arange(1, 7), atol=0.001)
    assert all(0 < std < 0.001 for std in drivetrain.no_load_current_std_A)
    assert "# Maxon RE 25, 24 V winding" in config.read_text()


@pytest.fixture
def braked(tmp_path: Path) -> Path:
    """Write a recording of wheel 3 under a brake: 33 mA, and gears that take 5 % more for each N m."""
    rng = np.random.default_rng(0)
    truth = Drivetrain(no_load_current_A=0.033, load_loss_per_Nm=0.05)  # type: ignore[arg-type]  # one for six
    lines = ["t_s,wheel,motor_current_A,motor_speed_rad_s,brake_torque_Nm"]
    for k, torque in enumerate(np.repeat([0.0, 0.5, 1.0, 1.5, 2.0, 1.5, 1.0, 0.5, 0.0], 40)):
        current = motor_current(np.full(6, torque), np.full(6, 400.0), truth)[2] + rng.normal(0, 0.001)
        lines.append(f"{k / 2},3,{current:.6f},400.0,{torque}")
    path = tmp_path / "brake.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_brake_test_updates_the_efficiency_against_torque(tmp_path: Path, braked: Path) -> None:
    """Wheel 3 alone is changed, and the torque computed from its current is the brake's at each torque."""
    config, plot = tmp_path / "rover.toml", tmp_path / "brake.svg"
    shutil.copy(ROOT / "rover.toml", config)
    done = calibrate("brake", braked, "--config", config, "--plot", plot)
    assert done.returncode == 0, done.stderr
    assert "wheel 3: gain 1.0" in done.stdout
    assert "at 0.5 N m" in done.stdout
    assert plot.stat().st_size > 10_000
    drivetrain = Configuration(**tomllib.loads(config.read_text())).drivetrain
    assert drivetrain.load_loss_per_Nm[2] == pytest.approx(0.05, abs=4 * drivetrain.load_loss_std_per_Nm[2])
    assert drivetrain.load_loss_per_Nm[0] == 0
    calibrated = drivetrain.model_copy(update={"no_load_current_A": (0.033,) * 6})
    for torque in (0.5, 1.0, 2.0):
        current = 0.033 + torque * (1 + 0.05 * torque) / Drivetrain().gain_Nm_per_A
        assert wheel_torque(np.full(6, current), np.full(6, 400.0), calibrated)[2] == pytest.approx(torque, rel=0.02)


def test_a_distance_updates_the_radius_and_draws_a_figure(tmp_path: Path) -> None:
    """Six wheels of 76 mm that roll 6 m give a radius of 76 mm within three standard deviations."""
    config, plot = tmp_path / "rover.toml", tmp_path / "radius.svg"
    shutil.copy(ROOT / "rover.toml", config)
    time = np.arange(0, 130, 0.5)
    speed = np.where((time > 4) & (time < 124), 6 / 0.076 * 1400 / 120, 0.0)
    rows = [f"{t},{wheel},{s}" for t, s in zip(time, speed, strict=True) for wheel in range(1, 7)]
    recording = tmp_path / "drive.csv"
    recording.write_text("t_s,wheel,motor_speed_rad_s\n" + "\n".join(rows) + "\n")
    done = calibrate("radius", recording, "--distance", 6.0, "--config", config, "--plot", plot)
    assert done.returncode == 0, done.stderr
    assert plot.stat().st_size > 10_000
    wheel = Configuration(**tomllib.loads(config.read_text())).wheel
    assert wheel.radius_m == pytest.approx(0.076, abs=3 * wheel.radius_std_m)


def test_a_dry_run_writes_nothing(tmp_path: Path, spin: Path) -> None:
    """A dry run prints the values and leaves the file unchanged."""
    config = tmp_path / "rover.toml"
    shutil.copy(ROOT / "rover.toml", config)
    before = config.read_bytes()
    done = calibrate("wheels-up", spin, "--config", config, "--dry-run")
    assert config.read_bytes() == before
    assert "wheel 6: 3" in done.stdout
    assert done.returncode == 0


def test_without_a_recording_the_command_prints_instructions() -> None:
    """Without a recording each command prints the instructions for the bench."""
    for name in ("load-cell", "wheels-up", "brake", "radius"):
        assert "  1. " in CliRunner().invoke(app, ["calibrate", name]).stdout


def test_a_recording_without_weights_is_an_error_that_names_the_column(spin: Path) -> None:
    """The error names the missing column, and the exit code is 1."""
    done = calibrate("load-cell", spin, "--config", ROOT / "rover.toml")
    assert done.returncode == 1
    assert "weight_kg" in done.stderr


def test_a_configuration_that_is_not_there_is_named_with_what_to_give(spin: Path, tmp_path: Path) -> None:
    """The default is `rover.toml` of the working folder, which is seldom meant."""
    done = calibrate("wheels-up", spin, "--config", tmp_path / "rover.toml")
    assert done.returncode == 1
    assert done.stderr == f"{tmp_path}/rover.toml: there is no such file. Name the rover's rover.toml with --config.\n"


def test_the_daemon_corrects_loads_by_zero_and_span() -> None:
    """A load cell with a zero of 2 N and a span of 1.1 is corrected before the smoothing."""
    cells = LoadCells(zero_N=2.0, span=1.1)  # type: ignore[arg-type]  # one value for six wheels
    configuration = Configuration(load_cells=cells, smoothing=Smoothing(window_s=0.0, time_constant_s=0.0))
    values = np.full((len(QUANTITIES), 6), np.nan)
    values[ROW[LOAD]] = 52.0
    values[ROW[MOTOR_CURRENT]] = 0.08
    values[ROW[MOTOR_SPEED]] = 400.0
    estimate = Pipeline(configuration, load_models(configuration)).step(Snapshot(0, 10**18, values))
    np.testing.assert_allclose(estimate.smoothed_load_N, 55.0)
