"""Write a recording (CSV of `regolithd mismatch`) of the virtual rover, without bus, nodes or waiting.

    python virtual_recording.py OUT.csv [SCENARIO.toml]

Twenty minutes at 2 Hz with six speeds, forwards and backwards, so that friction, slope and soil can be distinguished.
The effects of the scenario's `[hidden]` are in it; the bus voltage falls with the recorded currents.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from regolithd.daemon.simulator.scenario import Scenario, read_scenario
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

HEADER = (
    *("t_s", "wheel", "motor_current_A", "motor_speed_rad_s", "load_N", "ground_speed_m_s", "pitch_rad", "roll_rad"),
    *("yaw_rate_rad_s", "motor_temperature_degC", "bus_voltage_V"),
)
RATE_HZ = 2.0
SECONDS = 1200
WHEEL_SPEEDS_RAD_S = (0.3, 0.2, -0.3, 0.35, 0.15, -0.2)
EACH_S = 40


def rows(scenario: Scenario) -> list[list[float]]:
    """Return the recording, one row per instant and wheel."""
    world, table = VirtualWorld(scenario), []
    for k in range(int(SECONDS * RATE_HZ)):
        time_s = k / RATE_HZ
        wheel_speed = WHEEL_SPEEDS_RAD_S[int(time_s / EACH_S) % len(WHEEL_SPEEDS_RAD_S)]
        speed = np.full(6, wheel_speed * scenario.drivetrain.ratio)
        read = world.measure(time_s, speed)
        body = [read.pitch_rad, read.roll_rad, read.yaw_rate_rad_s]
        for wheel in range(6):
            measured = [read.motor_current_A[wheel], speed[wheel], read.load_N[wheel], read.hub_speed_m_s[wheel]]
            table.append([time_s, wheel + 1, *measured, *body, read.motor_temperature_degC[wheel], read.bus_voltage_V])
    return table


def main(out: Path, scenario: Path | None) -> None:
    """Write the file."""
    with out.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(HEADER)
        writer.writerows(rows(Scenario() if scenario is None else read_scenario(scenario)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
