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
    to: Annotated[Path, typer.Option(help="Output file: .csv or .parquet.")],
) -> None:
    """Write a recording as one table, CSV or Parquet, with one row for each instant and wheel.

    The columns are those that `regolithd mismatch` and `regolithd calibrate` read.
    """
    from regolithd.daemon.recording.export import ExportError
    from regolithd.daemon.recording.export import export as write
    from regolithd.daemon.recording.progress import open_binary

    try:
        count = write(recordings, to, open_binary)
    except (ExportError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo(f"{to}: {count} rows")
