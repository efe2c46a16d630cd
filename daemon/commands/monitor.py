"""`regolithd monitor`: follow a recording while it grows, and report drag (or another effect) that begins."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.daemon.mismatch.online.monitoring import Told

EXIT_DATA = 65


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("monitor")(monitor)


def monitor(
    recording: Annotated[
        Path, typer.Argument(help="Folder of a running daemon's recordings, or one file: MCAP, CSV, or Parquet.")
    ],
    *,
    simulation: Annotated[Path, typer.Option(help="SIM.toml: the simulation and its parameters.")],
    follow: Annotated[bool, typer.Option("--follow", help="Wait for more, until the file is closed.")] = False,
    json: Annotated[
        Path | None, typer.Option(help="Append what is known after each minute here, a line of JSON each.")
    ] = None,
    publish: Annotated[
        Path | None,
        typer.Option(metavar="ROVER.toml", help="Have the daemon of this rover.toml publish each new report."),
    ] = None,
) -> None:
    """Follow a recording while it grows, and report drag (or another effect of the library) that begins.

    A sequential test: after each minute, every effect on every set of wheels from every minute on is held against
    "nothing has begun". One threshold bounds the rate of false reports over all of them. The first ten minutes of
    driving show how strong the noise is. When the recording has ended, `regolithd mismatch` decides what it was.
    """
    from regolithd.daemon.one_thread import compute_with_one_thread

    compute_with_one_thread()
    from regolithd.calibration.mismatch.errors import MismatchError
    from regolithd.daemon.mismatch.online.monitoring import monitored

    try:
        told = monitored(recording, simulation, follow=follow, announce=lambda text: typer.echo(text, err=True))
        _tell(told, simulation, json, publish)
    except KeyboardInterrupt:
        raise typer.Exit from None
    except (MismatchError, OSError) as error:
        typer.echo(f"regolithd monitor: {error}", err=True)
        raise typer.Exit(EXIT_DATA) from error


def _tell(every: Iterator[Told], simulation: Path, json: Path | None, publish: Path | None) -> None:
    from regolithd.daemon.mismatch.online.monitoring import identities, line_of, lines_of

    before: Told | None = None
    for told in every:
        for line in lines_of(told, before):
            typer.echo(line)
        if json:
            with json.open("a", encoding="utf-8") as file:
                file.write(line_of(told) + "\n")
        if publish and identities(told) != identities(before):
            _publish(told, simulation, publish)
        before = told


def _publish(told: Told, simulation: Path, config: Path) -> None:
    """Publish; a daemon that does not answer ends nothing: the next report is tried again."""
    from regolithd.daemon.commands.compare import publish_result
    from regolithd.daemon.control.client import ControlError
    from regolithd.daemon.mismatch.online.result import monitoring_result
    from regolithd.daemon.setup import configuration_or_exit

    try:
        publish_result(configuration_or_exit(config), monitoring_result(told, simulation))
    except ControlError as error:
        typer.echo(f"not published: {error}", err=True)
