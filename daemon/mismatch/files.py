"""What `regolithd mismatch` writes: the answer as JSON, the report, the corrected SIM.toml."""

from __future__ import annotations

import json
import os
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.corrected import corrected_tables
from regolithd.calibration.mismatch.report.page import Provenance, write_report
from regolithd.calibration.mismatch.simulation.load import model_folder
from regolithd.calibration.toml_document import with_tables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.comparison import Comparison
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


def write_json(path: Path, answer: Answer) -> None:
    """Write the answer."""
    path.write_text(json.dumps(answer.to_json(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def write_corrected(
    path: Path, found: Comparison, simulated: Simulation, simulation: Path, tables: Mapping[str, Any]
) -> None:
    """Write SIM.toml with the calibrated parameters and the effects; the user's comments and order stay.

    In another folder than SIM.toml, `[simulation] path` leads to the user's class or FMU.
    """
    evidence, answer = found.evidence, found.answer
    imitating = bool(answer.unexplained)
    terms = evidence.contributions
    new = corrected_tables(tables, simulated, evidence.values, terms, answer.effects, within_priors=imitating)
    if path.resolve().parent != simulation.resolve().parent and tables["simulation"]["model"] != "rover-wheel":
        folder = model_folder(tables, simulation.resolve().parent)
        new["simulation"] = {**new["simulation"], "path": os.path.relpath(folder.resolve(), path.resolve().parent)}
    path.write_text(with_tables(simulation.read_text(encoding="utf-8-sig"), new), encoding="utf-8")


def write_page(path: Path, found: Comparison, recordings: Sequence[Path], simulation: Path) -> None:
    """Write the report, with names and SHA-256 of the files that it came from."""
    digests = [sha256(file.read_bytes()).hexdigest() for file in (*recordings, simulation)]
    names = [recording.name for recording in recordings]
    command = f"regolithd mismatch {' '.join(names)} --simulation {simulation.name} --report {path.name}"
    source = Provenance(", ".join(names), simulation.name, ", ".join(digests[:-1]), digests[-1], command)
    write_report(path, found.answer, found.evidence, source)
