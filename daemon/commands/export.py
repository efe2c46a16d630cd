"""`regolithd export`: a recording as CSV or Parquet."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(help="Write a recording as one table: CSV or Parquet, one row per instant and wheel.")(export)


def export(
    recordings: Annotated[list[Path], typer.Argument(help="MCAP files, in their order", exists=True, dir_okay=False)],
    to: Annotated[Path, typer.Option(help="out.csv or out.parquet")],
) -> None:
    """Write the columns that `regolithd mismatch` reads."""
    from regolithd.daemon.recording.export import ExportError
    from regolithd.daemon.recording.export import export as write
    from regolithd.daemon.recording.progress import open_binary

    try:
        count = write(recordings, to, open_binary)
    except (ExportError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo(f"{to}: {count} rows")
