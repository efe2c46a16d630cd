"""The bench commands: they guide, fit a recording, draw it, and write what the daemon then reads."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.parameters import LoadCells
from daemon.cli import app
from daemon.config import Configuration, Smoothing
from daemon.estimate import SHIPPED_MODEL, Network
from daemon.pipeline import Pipeline
from daemon.snapshot import QUANTITIES, ROW, Snapshot
from drivers.signals import Quantity

ROOT = Path(__file__).parents[2]


def calibrate(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command."""
    command = [sys.executable, "-m", "daemon", "calibrate", *map(str, arguments)]
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


def test_a_spin_becomes_the_daemons_drivetrain(tmp_path: Path, spin: Path) -> None:
    """The values stand in rover.toml for each wheel, with their deviations, and the daemon takes the file."""
    config, plot = tmp_path / "rover.toml", tmp_path / "spin.png"
    shutil.copy(ROOT / "rover.toml", config)
    done = calibrate("wheels-up", spin, "--config", config, "--plot", plot)
    assert done.returncode == 0, done.stderr
    assert plot.stat().st_size > 10_000
    drivetrain = Configuration(**tomllib.loads(config.read_text())).drivetrain
    np.testing.assert_allclose(drivetrain.no_load_current_A, 0.030 + 0.001 * np.arange(1, 7), atol=0.001)
    assert all(0 < std < 0.001 for std in drivetrain.no_load_current_std_A)
    assert "# Maxon RE 25, 24 V winding" in config.read_text()


def test_a_dry_run_writes_nothing(tmp_path: Path, spin: Path) -> None:
    """What would be written is said, and the file stays."""
    config = tmp_path / "rover.toml"
    shutil.copy(ROOT / "rover.toml", config)
    before = config.read_bytes()
    done = calibrate("wheels-up", spin, "--config", config, "--dry-run")
    assert config.read_bytes() == before
    assert "wheel 6: 3" in done.stdout
    assert done.returncode == 0


def test_without_a_recording_the_command_guides() -> None:
    """Each procedure says what to do at the bench."""
    for name in ("load-cell", "wheels-up", "brake", "radius"):
        assert "  1. " in CliRunner().invoke(app, ["calibrate", name]).stdout


def test_a_recording_without_the_weights_says_what_is_missing(spin: Path) -> None:
    """The message names the column, and nothing is written."""
    done = calibrate("load-cell", spin, "--config", ROOT / "rover.toml")
    assert done.returncode == 1
    assert "weight_kg" in done.stderr


def test_the_daemon_corrects_loads_by_what_the_bench_found() -> None:
    """A cell that reads 2 N too much and a tenth too little is put right before anything is estimated from it."""
    cells = LoadCells(zero_N=2.0, span=1.1)  # type: ignore[arg-type]  # one value for six wheels
    configuration = Configuration(load_cells=cells, smoothing=Smoothing(window_s=0.0, time_constant_s=0.0))
    values = np.full((len(QUANTITIES), 6), np.nan)
    values[ROW[Quantity.LOAD]] = 52.0
    values[ROW[Quantity.MOTOR_CURRENT]] = 0.08
    values[ROW[Quantity.MOTOR_SPEED]] = 400.0
    estimate = Pipeline(configuration, Network(SHIPPED_MODEL)).step(Snapshot(0, 10**18, values))
    np.testing.assert_allclose(estimate.smoothed_load_N, 55.0)
