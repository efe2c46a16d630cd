"""`regolithd replay`: recompute all estimates from a candump log and compare them with the recording."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regolithd.daemon.recording.replay import Replayed


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
    """Recompute all estimates from candump logs, and compare them with the recordings (MCAP) beside the logs.

    Prints counters and a digest of all numbers. What is damaged is left out and named on the standard error. Exit
    status 1 if something is, if a recorded message differs, or if there is nothing to replay or, without `--config`,
    to compare with.
    """
    from regolithd.daemon.recording.progress import open_text
    from regolithd.daemon.recording.replay import ReplayError, replay_logs
    from regolithd.daemon.setup import configuration_or_exit, models_or_exit, recorded_configuration

    beside = logs[0].with_suffix(".mcap")
    configuration = configuration_or_exit(config) if config else recorded_configuration(beside)
    if model is not None:
        estimator = configuration.estimator.model_copy(update={"model": model})
        configuration = configuration.model_copy(update={"estimator": estimator})
    models = models_or_exit(configuration)
    try:
        result = replay_logs(logs, configuration, models, open_text)
    except (ReplayError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    _print_counters(result)
    for text in (*result.damage, *result.incomplete):
        typer.echo(text, err=True)
    _print_comparison(result)
    if result.different or result.damage or not (result.compared or (config and result.digest.count)):
        raise typer.Exit(1)


def _print_counters(result: Replayed) -> None:
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


def _print_comparison(result: Replayed) -> None:
    if result.different:
        typer.echo(f"DIFFERENT from the recording in {len(result.different)} messages:", err=True)
        for line in result.different[:5]:
            typer.echo(f"  {line}", err=True)
        causes = "another configuration or network, a damaged log, or the preceding log is missing"
        typer.echo(f"Possible causes: {causes}.", err=True)
    elif result.compared:
        typer.echo(f"identical  to the last bit with the {result.compared} messages recorded then")
    else:
        typer.echo("compared   with nothing: no .mcap beside the logs has these snapshots", err=True)
    if result.compared and result.not_compared:
        messages = f"{result.not_compared} of the {2 * result.digest.count} messages that the logs give"
        typer.echo(f"not compared: {messages}, because no .mcap beside the logs has them", err=True)
