"""`regolithd replay`: recompute all estimates from a candump log and compare them with the recording."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("replay")(replay)


def replay(
    logs: Annotated[
        list[Path], typer.Argument(help="candump logs, in chronological order.", exists=True, dir_okay=False)
    ],
    config: Annotated[
        Path | None, typer.Option(help="The rover.toml; default: the one in the MCAP file beside the first log.")
    ] = None,
    model: Annotated[Path | None, typer.Option(help="ONNX terrain network to use instead.")] = None,
) -> None:
    """Recompute all estimates from candump logs, and compare them with the recording (MCAP) beside the first log.

    Prints counters and a digest of all numbers. Exit status 1 if a recorded message differs, or if there is nothing to
    replay or, without `--config`, to compare with.
    """
    from regolithd.daemon.recording.mcap_file import DamagedRecordingError
    from regolithd.daemon.recording.progress import open_text
    from regolithd.daemon.recording.replay import replay_logs
    from regolithd.daemon.setup import configuration_or_exit, models_or_exit, recorded_configuration

    beside = logs[0].with_suffix(".mcap")
    configuration = configuration_or_exit(config) if config else recorded_configuration(beside)
    if model is not None:
        estimator = configuration.estimator.model_copy(update={"model": model})
        configuration = configuration.model_copy(update={"estimator": estimator})
    models = models_or_exit(configuration)
    try:
        result = replay_logs(logs, configuration, models, open_text)
    except (DamagedRecordingError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo(f"frames     {result.frames}")
    typer.echo(f"snapshots  {result.digest.count}")
    if result.counters:
        counters = result.counters
        typer.echo(
            f"readings   {counters.accepted} accepted, {counters.missing} missing, {counters.late} late, "
            f"{counters.duplicate} duplicate, {counters.unexpected} unexpected"
        )
    for reason, count in result.undecodable.items():
        typer.echo(f"undecoded  {count} {reason}")
    typer.echo(f"digest     {result.digest}")
    if result.different:
        typer.echo(f"DIFFERENT from the recording in {len(result.different)} messages:", err=True)
        for line in result.different[:5]:
            typer.echo(f"  {line}", err=True)
        typer.echo("Possible causes: another configuration or network, or the preceding log is missing.", err=True)
        raise typer.Exit(1)
    if result.compared:
        typer.echo(f"identical  to the last bit with the {result.compared} messages recorded then")
        return
    typer.echo(f"compared   with nothing: no {beside.name} beside the log has these snapshots", err=True)
    if config is None or not result.digest.count:
        raise typer.Exit(1)
