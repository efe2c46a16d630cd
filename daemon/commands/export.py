"""`regolithd export`: write a recording as CSV or Parquet."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("export")(export)


def export(
    recordings: Annotated[
        list[Path], typer.Argument(help="MCAP files, in chronological order.", exists=True, dir_okay=False)
    ],
    to: Annotated[Path, typer.Option(help="Output file: .csv or .parquet; .nc (NetCDF) has everything.")],
    *,
    everything: Annotated[
        bool, typer.Option("--everything", help="Also the estimates: torque, slip, c, φ, posterior, alarms, UTC.")
    ] = False,
) -> None:
    """Write a recording as one table, CSV or Parquet, with one row for each instant and wheel; or as NetCDF.

    The columns are those that `regolithd mismatch` and `regolithd calibrate` read; with `--everything`, and in NetCDF,
    all that was estimated from them as well. What is damaged is left out and named on the standard error; the exit
    status is 1 then, and if there is no row. A file of that name is replaced once everything is written.
    """
    from regolithd.daemon.recording.replacement import ExportError

    if len({path.resolve() for path in recordings}) < len(recordings):
        raise typer.BadParameter("a recording is named twice, and its rows would be there twice. Name each once.")
    gaps: list[str] = []
    long = everything or to.suffix == ".nc"
    try:
        count = _write(recordings, to, long, gaps.append)
    except (ExportError, OSError) as error:
        _remark(gaps, recordings)
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    _remark(gaps, recordings)
    typer.echo(f"{to}: {count} {'instants' if long else 'rows'}")
    if gaps:
        raise typer.Exit(1)


def _write(recordings: list[Path], to: Path, long: bool, on_gap: Callable[[str], None]) -> int:
    from regolithd.daemon.recording.export import export as measured
    from regolithd.daemon.recording.export_results import export_results
    from regolithd.daemon.recording.progress import open_binary
    from regolithd.daemon.recording.results import read_results

    if long:
        return export_results(read_results(recordings, open_binary, on_gap), to)
    return measured(recordings, to, open_binary, on_gap)


def _remark(gaps: list[str], recordings: list[Path]) -> None:
    """Say what is damaged, empty, incomplete or out of order."""
    from itertools import pairwise

    from regolithd.daemon.recording.mcap_file import first_time, incomplete

    for text in (*gaps, *filter(None, map(incomplete, recordings))):
        typer.echo(text, err=True)
    begins = [(recording, begin) for recording in recordings if (begin := first_time(recording))]
    for (before, begin), (recording, later) in pairwise(begins):
        if later < begin:
            what = f"begins before {before}, which is named before it, so the rows are not in chronological order"
            typer.echo(
                f"{recording}: {what}. Name the recordings in the order of the numbers in their names.", err=True
            )
