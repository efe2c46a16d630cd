"""`regolithd mismatch`: name the physics that a simulation leaves out, from a recording."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads the annotations when it runs
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.comparison import Comparison
    from regolithd.calibration.mismatch.data.recording import Recording

EXIT_DATA = 65
"""EX_DATAERR: recording or simulation cannot be used."""


def register(app: typer.Typer) -> None:
    """Add the command."""

    @app.command()
    def mismatch(
        recording: Annotated[Path, typer.Argument(help="CSV(.gz), Parquet, or MCAP of the daemon.")],
        simulation: Annotated[Path, typer.Option(help="SIM.toml: the simulation and its parameters.")],
        json: Annotated[Path | None, typer.Option(help="Write the answer here, as JSON.")] = None,
        report: Annotated[Path | None, typer.Option(help="Write a self-contained HTML report here.")] = None,
        corrected: Annotated[Path | None, typer.Option(help="Write the corrected SIM.toml here.")] = None,
    ) -> None:
        """Name the physics that a simulation leaves out, from a recording.

        Prints each effect with size and interval, indistinguishable effects, and the held-out error before and after.
        """
        from regolithd.calibration.mismatch.errors import MismatchError

        try:
            _run(recording, simulation, json, report, corrected)
        except (MismatchError, OSError) as error:
            typer.echo(f"regolithd mismatch: {error}", err=True)
            raise typer.Exit(EXIT_DATA) from error


def _run(recording: Path, simulation: Path, json: Path | None, report: Path | None, corrected: Path | None) -> None:
    from rich.console import Console

    from regolithd.calibration.mismatch.comparison import compare
    from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects
    from regolithd.calibration.mismatch.simulation.load import load_simulation
    from regolithd.calibration.toml_document import with_tables

    tables = _tables(simulation)
    simulated = load_simulation(tables, beside=simulation.resolve().parent)
    errors = Console(stderr=True)
    with errors.status("reading") as status:
        recorded = _read(recording, simulated.wheel_column)
        found = compare(recorded, simulated, effects=stated_effects(tables), progress=status.update)
    if json:
        _write_json(json, found.answer)
    if corrected:
        evidence = found.evidence
        new = corrected_tables(tables, simulated, evidence.values, evidence.contributions, found.answer.effects)
        # The user's own comments and order stay.
        corrected.write_text(with_tables(simulation.read_text(encoding="utf-8"), new), encoding="utf-8")
    if report:
        _write_report(report, found, recording, simulation)
    _print_answer(Console(), found.answer)


def _tables(path: Path) -> dict[str, Any]:
    import tomllib

    from regolithd.calibration.mismatch.errors import SimulationError

    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SimulationError(f"{path} is not TOML: {error}") from error


def _read(path: Path, unit: str) -> Recording:
    from regolithd.calibration.mismatch.data.recording import from_columns, read_recording

    if path.suffix != ".mcap":
        return read_recording(path, unit=unit)
    import numpy as np

    from regolithd.calibration.mismatch.errors import RecordingError
    from regolithd.daemon.recording.export import HEADER, recorded_snapshots, rows
    from regolithd.daemon.recording.mcap_file import DamagedRecordingError

    try:
        table = np.array(list(rows(recorded_snapshots([path]))), np.float64).reshape(-1, len(HEADER))
    except DamagedRecordingError as error:
        raise RecordingError(f"{error} `regolithd export` writes what can be read.") from error
    return from_columns(dict(zip(HEADER, table.T, strict=True)), unit=unit)


def _write_json(path: Path, answer: Answer) -> None:
    import json

    path.write_text(json.dumps(answer.to_json(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _write_report(path: Path, found: Comparison, recording: Path, simulation: Path) -> None:
    from hashlib import sha256

    from regolithd.calibration.mismatch.report.page import Provenance, write_report

    first, second = (sha256(file.read_bytes()).hexdigest() for file in (recording, simulation))
    command = f"regolithd mismatch {recording.name} --simulation {simulation.name} --report {path.name}"
    write_report(
        path, found.answer, found.evidence, Provenance(recording.name, simulation.name, first, second, command)
    )


def _print_answer(console: Any, answer: Answer) -> None:  # noqa: ANN401  # rich's console
    console.print(f"[bold]{answer.verdict}[/bold]")
    for effect in answer.effects:
        console.print(f"  {effect.name}: {effect.statement}")
    for rest in answer.unexplained:
        console.print(
            f"  unexplained: {100 * rest.share_of_residual:.0f} % of the residual follows {rest.covariate} on wheels "
            f"{', '.join(map(str, rest.wheels))}, {rest.from_s:.0f} to {rest.to_s:.0f} s"
        )
    for pair in answer.indistinguishable:
        console.print(f"  {' or '.join(pair.effects)}: this recording does not distinguish them. {pair.experiment}")
    fit = answer.fit
    console.print(
        f"  held-out error of {fit.channel}: {fit.held_out_rmse_before:.5g} before, "
        f"{fit.held_out_rmse_after:.5g} after, noise floor {fit.noise_floor_rmse:.5g}"
    )
    for note in answer.notes:
        console.print(f"  note: {note}")
