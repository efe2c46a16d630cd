"""One comparison from files to files."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import typer

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.errors import MismatchError, RecordingError
from regolithd.calibration.mismatch.report.labels import Labels
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.daemon.mismatch.files import Outputs, write_json, write_page
from regolithd.daemon.mismatch.fleet import FleetOptions, files_of_rovers, run_fleet, too_long_at_once
from regolithd.daemon.mismatch.recordings import read_recordings
from regolithd.daemon.mismatch.terminal import print_answer
from regolithd.daemon.terminal import terminal

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer


LIKELY = 0.5
"""Probability of an answer below which another is as likely as it, so that its corrected file is warned of."""

NO_FLEET = FleetOptions()
"""No option that only a fleet has."""


def run(recordings: Sequence[Path], simulation: Path, outputs: Outputs, options: FleetOptions = NO_FLEET) -> Answer:
    """Compare, write the outputs, print the answer and return it.

    Recordings of one rover are runs of one recording, unless an option of `FleetOptions` is given, or they are long.

    Raises
    ------
    MismatchError
        When recording or simulation cannot be used.
    """
    outputs.check()
    files = files_of_rovers(recordings, options.rover_from)
    if options.asked_for or len({file.rover for file in files if not file.damaged}) > 1 or too_long_at_once(files):
        return run_fleet(files, simulation, outputs, options)
    simulated = load_simulation(simulation, announce=partial(typer.echo, err=True))
    with terminal(stderr=True).status("reading") as status:
        recorded = read_recordings(recordings, simulated.wheel_column)
        try:
            found = compare(recorded, simulated, progress=status.update)
        except RecordingError as error:
            raise RecordingError(f"{', '.join(map(str, recordings))}: {error}") from error
    if outputs.json:
        write_json(outputs.json, found.answer)
    if outputs.report:
        write_page(outputs.report, found, recordings, simulation)
    print_answer(terminal(), found.answer, Labels.of(found.evidence), found.evidence.wheels)
    if outputs.corrected:  # last: an answer that it cannot hold is an answer all the same
        try:
            found.write_corrected(outputs.corrected, empirical=outputs.empirical)
        except MismatchError as error:
            raise MismatchError(f"{outputs.corrected} is not written: {error}") from error
        if (probability := found.answer.probability) is not None and probability < LIKELY:
            typer.echo(
                f"{outputs.corrected}: it holds an answer with a probability of {probability:.2g}; look at what else "
                "may be true, and record what tells them apart, before you use it",
                err=True,
            )
    return found.answer
