"""Bring a part of the Silverbox's recording into a table with a row for each instant.

python convert.py SNLS80mV.mat 40500 60500 train.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from scipy.io import loadmat

SAMPLES_PER_S = 1e7 / 2**14
"""Sampling frequency, as published [1/s]."""


def convert(published: Path, first: int, end: int, recording: Path) -> None:
    """Write the samples from `first` to before `end`."""
    table = loadmat(published)
    with recording.open("w", newline="") as out:
        written = csv.writer(out)
        written.writerow(("t_s", "input_V", "output_V"))
        pairs = zip(table["V1"].ravel()[first:end], table["V2"].ravel()[first:end], strict=True)
        written.writerows((index / SAMPLES_PER_S, force, position) for index, (force, position) in enumerate(pairs))


if __name__ == "__main__":
    convert(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
