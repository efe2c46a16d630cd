"""`regolithd schema`: write AsyncAPI document and JSON Schemas of the MQTT messages."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("schema")(schema)


def schema(
    write: Annotated[Path | None, typer.Option(help="Folder to write JSON Schemas, AsyncAPI and table to.")] = None,
) -> None:
    """Print the AsyncAPI document of the MQTT messages, or write it and every JSON Schema to a folder."""
    from regolithd.daemon.messages.documents import documents

    files = documents()
    if write is None:
        typer.echo(files["asyncapi.json"], nl=False)
        return
    try:
        write.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (write / name).write_text(text, encoding="utf-8")
    except OSError as error:
        typer.echo(f"{write}: {error.strerror}. Name a folder that can be written with --write.", err=True)
        raise typer.Exit(1) from error
    typer.echo(f"{len(files)} files written to {write}.")
