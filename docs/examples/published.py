"""The published recordings that the worked examples run on: their files, and how each is cut into two parts.

The first part is compared; the second part chooses nothing, and shows how well the corrected simulation carries over.
"""

from __future__ import annotations

import csv
import gzip
import runpy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

HERE = Path(__file__).resolve().parent
Parts = tuple[Path, Path]


@dataclass(frozen=True)
class Example:
    """A recording, and the simulation that it is compared with.

    Attributes
    ----------
    name: of the figures and reports
    folder: of the simulation, below docs/examples
    file: the published file, below the folder of recordings
    stated: what its literature states, in a few words
    parts: writes the two parts into a folder: parts(file, folder)
    """

    name: str
    folder: str
    file: str
    stated: str
    parts: Callable[[Path, Path], Parts]

    @property
    def simulation(self) -> Path:
        """SIM.toml."""
        return HERE / self.folder / "SIM.toml"


def converted(folder: str, *arguments: str, share: float) -> Callable[[Path, Path], Parts]:
    """Return what converts a file with the folder's own script, and cuts the table."""

    def parts(file: Path, into: Path) -> Parts:
        table = into / "all.csv"
        convert = runpy.run_path(str(HERE / folder / "convert.py"))["convert"]
        convert(file, *(int(each) if each.isdigit() else each for each in arguments), table)
        return cut(table, into, share)

    return parts


def cut(table: Path, into: Path, share: float) -> Parts:
    """Write the first share of a table's runs, or of the time of its only run, and the rest."""
    text = gzip.decompress(table.read_bytes()) if table.suffix == ".gz" else table.read_bytes()
    header, *rows = csv.reader(text.decode().splitlines())
    by = header.index("run" if "run" in header else "t_s")
    ordered = sorted({float(row[by]) for row in rows})
    last = ordered[int(share * len(ordered)) - 1]
    first_part, second_part = into / "compared.csv", into / "unseen.csv"
    for path, wanted in ((first_part, True), (second_part, False)):
        with path.open("w", newline="") as out:
            csv.writer(out).writerows([header, *(row for row in rows if (float(row[by]) <= last) == wanted)])
    return first_part, second_part


def tanks(file: Path, into: Path) -> Parts:
    """Return the benchmark's own two recordings."""
    convert = runpy.run_path(str(HERE / "cascaded_tanks/convert.py"))["convert"]
    parts = into / "compared.csv", into / "unseen.csv"
    for which, path in zip(("Est", "Val"), parts, strict=True):
        convert(file, which, path)
    return parts


def silverbox(file: Path, into: Path) -> Parts:
    """Return two of the multisines, and the noise whose amplitude grows beyond theirs."""
    convert = runpy.run_path(str(HERE / "silverbox/convert.py"))["convert"]
    parts = into / "compared.csv", into / "unseen.csv"
    for (first, end), path in zip(((41_500, 58_500), (20_000, 37_000)), parts, strict=True):
        convert(file, first, end, path)
    return parts


def joint(name: str, number: int, stated: str) -> Example:
    """Return one joint of the UR10e."""
    file = f"ur10e/ur-20_01_22-joint_{number}.csv"
    return Example(f"ur10e_{name}", "ur10e", file, stated, converted("ur10e", str(number), share=0.6))


FRICTION = "Coulomb and viscous friction"
EXAMPLES = (
    Example("emps", "emps", "emps/train.csv.gz", FRICTION + ", asymmetric", lambda file, into: cut(file, into, 0.6)),
    Example(
        "husky_asphalt",
        "husky",
        "borealtc/asphalt-and-flooring.csv.gz",
        "turning resistance",
        converted("husky", "ASPHALT", share=0.6),
    ),
    Example(
        "husky_flooring",
        "husky",
        "borealtc/asphalt-and-flooring.csv.gz",
        "turning resistance",
        converted("husky", "FLOORING", share=0.6),
    ),
    Example(
        "cmu_wheel",
        "cmu_wheel",
        "cmu-single-wheel/smooth.csv",
        "lateral force from the slip angle",
        converted("cmu_wheel", share=0.7),
    ),
    joint("base", 1, FRICTION),
    joint("shoulder", 2, FRICTION),
    joint("wrist_1", 4, FRICTION),
    Example("cascaded_tanks", "cascaded_tanks", "cascaded-tanks/dataBenchmark.csv", "overflow of both tanks", tanks),
    Example("silverbox", "silverbox", "silverbox/SNLS80mV.mat", "a spring with a cubic term", silverbox),
)
