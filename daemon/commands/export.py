"""`regolithd export`: write a recording as CSV or Parquet."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import Annotated

import typer


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
    status is 1 then, and if there is no row.
    """
    from regolithd.daemon.recording.export import ExportError
    from regolithd.daemon.recording.export import export as measured
    from regolithd.daemon.recording.export_results import export_results
    from regolithd.daemon.recording.mcap_file import is_closed
    from regolithd.daemon.recording.progress import open_binary
    from regolithd.daemon.recording.results import read_results

    gaps: list[str] = []
    try:
        if everything or to.suffix == ".nc":
            count = export_results(read_results(recordings, open_binary, gaps.append), to)
        else:
            count = measured(recordings, to, open_binary, gaps.append)
    except (ExportError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    finally:
        for gap in gaps:
            typer.echo(gap, err=True)
    for recording in recordings:
        if not is_closed(recording):
            typer.echo(f"{recording}: was not closed; what was recorded last may be missing.", err=True)
    typer.echo(f"{to}: {count} {'instants' if everything or to.suffix == '.nc' else 'rows'}")
    if gaps:
        raise typer.Exit(1)
