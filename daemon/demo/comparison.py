"""Compare the demo's recording with a simulation that knows what the daemon was told: the drag is not in it."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

from regolithd.calibration.parameters import SOILS, Soil
from regolithd.daemon.demo.story import FIRM

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.config.configuration import Configuration

SOIL_STD = 0.03
SENSORS = {
    "load_relative_std": 0.07,
    "ground_speed_relative_std": 0.002,
    "pitch_std_rad": 0.001,
    "roll_std_rad": 0.001,
    "yaw_rate_std_rad_s": 0.0003,
}


def sim_toml(configuration: Configuration) -> str:
    """Return SIM.toml: the daemon's drivetrain, the firm soil with its standard deviations, the sensors' errors."""
    stated = {"cohesion_relative_std": SOIL_STD, "friction_angle_relative_std": SOIL_STD}
    soil = Soil.model_validate(SOILS[FIRM].model_dump() | stated)
    drivetrain = {name: list(value) if isinstance(value, tuple) else value for name, value in configuration.drivetrain}
    tables = {"drivetrain": drivetrain, "soil": soil.model_dump(), "sensors": SENSORS}
    lines = ["# What the daemon was told of the rover, and the soil on which it began.", "[simulation]"]
    lines.append('model = "rover-wheel"')
    for name, table in tables.items():
        lines += ["", f"[{name}]", *(f"{key} = {value}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def compare(recording: Path, configuration: Configuration) -> Path:
    """Run `regolithd mismatch` on the recording, which prints its answer; return the path of the report.

    Raises
    ------
    OSError
        It failed; its own message has been printed.
    """
    folder = recording.parent
    simulation, report = folder / "SIM.toml", folder / "report.html"
    simulation.write_text(sim_toml(configuration), encoding="utf-8")
    command = [sys.executable, "-m", "regolithd", "mismatch", str(recording), "--simulation", str(simulation)]
    done = subprocess.run([*command, "--report", str(report)], check=False)  # noqa: S603  # a command of this package
    if done.returncode:
        raise OSError("the comparison failed")
    return report
