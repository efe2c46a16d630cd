"""Bring one of the two recordings of the cascaded tanks into a table with a row for each instant.

python convert.py dataBenchmark.csv Est recording.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

STEP_S = 4.0
"""Sampling time, as published [s]."""


def convert(published: Path, which: str, recording: Path) -> None:
    """Write the recording `Est` (for estimation) or `Val` (for validation)."""
    with published.open() as text, recording.open("w", newline="") as out:
        written = csv.writer(out)
        written.writerow(("t_s", "pump_V", "level_V"))
        for index, row in enumerate(csv.DictReader(text)):
            written.writerow((index * STEP_S, row[f"u{which}"], row[f"y{which}"]))


if __name__ == "__main__":
    convert(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
