"""The input files of a solver: the recording as CSV, and the simulation's parameters as TOML."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING

import numpy as np
import tomlkit

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from regolithd.calibration.validation.blind_trials.recordings.generator import Tables, Trial

COLUMNS = (
    "t_s",
    "wheel",
    "motor_current_A",
    "motor_speed_rad_s",
    "load_N",
    "ground_speed_m_s",
    "pitch_rad",
    "roll_rad",
    "yaw_rate_rad_s",
    "motor_temperature_degC",
    "bus_voltage_V",
)
"""Columns of a recording; the units are in the names."""


def toml_text(tables: Tables) -> str:
    """Return the tables as TOML."""
    return tomlkit.dumps(tables)


def recording_columns(trial: Trial) -> list[NDArray[np.float64]]:
    """Return the recording's columns in the order of `COLUMNS`, one row for each instant and wheel."""
    traverse = trial.traverse
    gears = float(trial.tables["drivetrain"]["planetary_ratio"]) * float(trial.tables["drivetrain"]["harmonic_ratio"])
    rows, wheels = traverse.load_N.shape
    return [
        np.repeat(traverse.t_s, wheels),
        np.tile(np.arange(1.0, wheels + 1), rows),
        trial.current_A.ravel(),
        (traverse.wheel_speed_rad_s * gears).ravel(),
        trial.load_N.ravel(),
        trial.ground_speed_m_s.ravel(),
        *(np.repeat(each, wheels) for each in (trial.pitch_rad, trial.roll_rad, trial.yaw_rate_rad_s)),
        trial.temperature_degC.ravel(),
        np.repeat(traverse.voltage_V, wheels),
    ]


def recording_text(trial: Trial) -> str:
    """Return the recording as CSV, with seven significant digits."""
    table = np.column_stack(recording_columns(trial))
    line = ",".join(["%.6g", "%d", *["%.7g"] * (len(COLUMNS) - 2)])
    return ",".join(COLUMNS) + "\n" + "\n".join(line % tuple(row) for row in table) + "\n"


def write_trial(trial: Trial, folder: Path) -> tuple[Path, Path]:
    """Write `recording.csv.gz` and `SIM.toml` into the folder, and nothing else; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    recording, simulation = folder / "recording.csv.gz", folder / "SIM.toml"
    recording.write_bytes(gzip.compress(recording_text(trial).encode(), compresslevel=3, mtime=0))
    simulation.write_text(toml_text(trial.tables))
    return recording, simulation
