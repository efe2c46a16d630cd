"""One comparison from files to files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import typer
from rich.console import Console

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.errors import MismatchError, RecordingError
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.daemon.mismatch.files import write_json, write_page
from regolithd.daemon.mismatch.recordings import read_recordings
from regolithd.daemon.mismatch.terminal import print_answer

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer


@dataclass(frozen=True, slots=True)
class Outputs:
    """Paths to write to; None: not written."""

    json: Path | None = None
    report: Path | None = None
    corrected: Path | None = None

    def check(self) -> None:
        """Check that the folders are there, before minutes are spent.

        Raises
        ------
        MismatchError
            When one is not.
        """
        for path in (self.json, self.report, self.corrected):
            if path and not path.resolve().parent.is_dir():
                raise MismatchError(f"{path} cannot be written: there is no folder {path.parent}")


def run(recordings: Sequence[Path], simulation: Path, outputs: Outputs) -> Answer:
    """Compare, write the outputs, print the answer and return it.

    Raises
    ------
    MismatchError
        When recording or simulation cannot be used.
    """
    outputs.check()
    simulated = load_simulation(simulation, announce=partial(typer.echo, err=True))
    with Console(stderr=True).status("reading") as status:
        recorded = read_recordings(recordings, simulated.wheel_column)
        try:
            found = compare(recorded, simulated, progress=status.update)
        except RecordingError as error:
            raise RecordingError(f"{', '.join(map(str, recordings))}: {error}") from error
    if outputs.json:
        write_json(outputs.json, found.answer)
    if outputs.corrected:
        found.write_corrected(outputs.corrected)
    if outputs.report:
        write_page(outputs.report, found, recordings, simulation)
    print_answer(Console(), found.answer)
    return found.answer
