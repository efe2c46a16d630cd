"""What `regolithd mismatch` writes: the answer as JSON, and the report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from hashlib import file_digest
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.errors import MismatchError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.fleet.comparison import FleetComparison
    from regolithd.calibration.mismatch.result import Comparison


@dataclass(frozen=True, slots=True)
class Outputs:
    """Paths to write to; None: not written. `empirical`: whether the corrected simulation has curves without a name."""

    json: Path | None = None
    report: Path | None = None
    corrected: Path | None = None
    empirical: bool = False

    def check(self) -> None:
        """Check that the folders are there, before minutes are spent.

        Raises
        ------
        MismatchError
            When one is not, or a curve was asked for and no file to write it to.
        """
        if self.empirical and not self.corrected:
            raise MismatchError("--empirical adds to a corrected simulation: give --corrected FILE too")
        for path in (self.json, self.report, self.corrected):
            if path and not path.resolve().parent.is_dir():
                raise MismatchError(f"{path} cannot be written: there is no folder {path.parent}")


def write_json(path: Path, answer: Answer) -> None:
    """Write the answer."""
    path.write_text(json.dumps(answer.to_json(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def write_page(path: Path, found: Comparison, recordings: Sequence[Path], simulation: Path) -> None:
    """Write the report, with names and SHA-256 of the files that it came from."""
    # Most comparisons write no page.
    from regolithd.calibration.mismatch.report.page import write_report  # noqa: PLC0415
    from regolithd.calibration.mismatch.report.template import Provenance  # noqa: PLC0415

    digests = [digest_of(file) for file in (*recordings, simulation)]
    names = [recording.name for recording in recordings]
    command = f"regolithd mismatch {' '.join(names)} --simulation {simulation.name} --report {path.name}"
    source = Provenance(", ".join(names), simulation.name, ", ".join(digests[:-1]), digests[-1], command)
    write_report(path, found.answer, found.evidence, source)


def write_fleet_page(path: Path, found: FleetComparison, recordings: Sequence[Path], simulation: Path) -> None:
    """Write the report of many recordings, with names and SHA-256 of the files that it came from."""
    from regolithd.calibration.mismatch.fleet.report.page import FleetProvenance, fleet_report  # noqa: PLC0415

    names = short_names(recordings)
    digests = {names[recording]: digest_of(recording) for recording in recordings}
    command = f"regolithd mismatch RECORDINGS --simulation {simulation.name} --report {path.name}"
    source = FleetProvenance(digests, simulation.name, digest_of(simulation), command)
    path.write_text(fleet_report(found.answer, found.evidence, source), encoding="utf-8")


def short_names(paths: Iterable[Path]) -> dict[Path, str]:
    """Return what each file is called: its name, with its folders where two files have the same name."""
    different = set(paths)
    short = len({path.name for path in different}) == len(different)
    return {path: path.name if short else str(path) for path in different}


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file's content, as hexadecimal digits."""
    with path.open("rb") as content:
        return file_digest(content, "sha256").hexdigest()
