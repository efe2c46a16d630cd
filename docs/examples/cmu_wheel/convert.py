"""Bring the single-wheel trials into the contract's columns: one row per trial and force, one run per slip angle.

    python convert.py smooth.csv recording.csv

The two forces of a trial are the two axes of one machine: 1 longitudinal, 2 lateral. A run is a slip angle, so that
whole slip angles are held out.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

LONGITUDINAL, LATERAL = 1, 2


def convert(trials: Path, recording: Path) -> None:
    """Write both forces of every trial."""
    with trials.open() as text, recording.open("w", newline="") as out:
        written = csv.writer(out)
        written.writerow(
            (
                "run",
                "t_s",
                "axis",
                "force_N",
                "load_N",
                "sinkage_mm",
                "slip_angle_deg",
                "travel_mm_s",
                "rim_mm_s",
                "slip",
            )
        )
        for number, row in enumerate(csv.DictReader(text)):
            shared = [row[name] for name in ("W", "Z", "beta", "Vx", "Vr", "slip")]
            for axis, force in ((LONGITUDINAL, "Flon"), (LATERAL, "Flat")):
                written.writerow((round(float(row["beta"])), number, axis, row[force], *shared))


if __name__ == "__main__":
    convert(Path(sys.argv[1]), Path(sys.argv[2]))
