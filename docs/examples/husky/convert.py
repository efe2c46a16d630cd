"""Bring the Husky's log into the contract's columns: one row per instant and side, runs numbered, units in the names.

python convert.py asphalt-and-flooring.csv.gz ASPHALT recording.csv
"""

from __future__ import annotations

import csv
import gzip
import sys
from pathlib import Path

LEFT, RIGHT = 1, 2


def convert(log: Path, terrain: str, recording: Path) -> None:
    """Write one terrain's runs."""
    runs: dict[str, int] = {}
    with gzip.open(log, "rt") as text, recording.open("w", newline="") as out:
        written = csv.writer(out)
        written.writerow(
            (
                "run",
                "t_s",
                "wheel",
                "motor_current_A",
                "rim_speed_m_s",
                "yaw_rate_rad_s",
                "forward_m_s2",
                "other_rim_m_s",
            )
        )
        for row in csv.DictReader(text):
            if row["terr"] != terrain:
                continue
            run = runs.setdefault(row["run"], len(runs))
            for side, current, speed, other in ((LEFT, "curL", "velL", "velR"), (RIGHT, "curR", "velR", "velL")):
                written.writerow((run, row["time"], side, row[current], row[speed], row["wz"], row["ax"], row[other]))


if __name__ == "__main__":
    convert(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
