"""Bring the recording of one joint of a UR10e that moves alone into a table with named columns.

python convert.py ur-20_01_22-joint_1.csv 1 base.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

POSITION, SPEED, CURRENT = 1, 7, 13
"""First of the six columns of each quantity, one for each joint; column 0 is the time [s]."""


def convert(log: Path, joint: int, recording: Path) -> None:
    """Write current, angle and speed of the joint, 1 (base) to 6 (wrist 3)."""
    with log.open() as text, recording.open("w", newline="") as out:
        written = csv.writer(out)
        written.writerow(("t_s", "motor_current_A", "angle_rad", "speed_rad_s"))
        for row in csv.reader(text):
            written.writerow((row[0], *(row[first + joint - 1] for first in (CURRENT, POSITION, SPEED))))


if __name__ == "__main__":
    convert(Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
