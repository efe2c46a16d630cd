"""`regolithd compare`: compare the last traverse with the simulation, and publish the result."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.messages.mismatch import ComparisonResult
    from regolithd.daemon.mismatch.traverse import TraverseFiles

EXIT_DATA = 65
EXIT_DAEMON = 69
"""EX_UNAVAILABLE: the comparison is written, and no daemon publishes it; systemd tries again."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("compare")(compare)


def compare(
    *,
    config: Annotated[Path | None, typer.Option(help="The rover.toml of the daemon.")] = None,
    simulation: Annotated[
        Path | None, typer.Option(help="SIM.toml; by default that beside rover.toml, or one made from rover.toml.")
    ] = None,
    publish: Annotated[bool, typer.Option(help="Have the daemon publish the result, and an alarm.")] = True,
) -> None:
    """Compare the recording of the last traverse with the simulation, and publish the result.

    A process of its own, never in the daemon; `regolithd-compare.path` starts it after each traverse. The report is
    written to `comparisons`, beside the recordings, with the corrected simulation. The alarm `mismatch` is raised when
    the simulation lacks physics, or when an effect of a corrected simulation has changed.
    """
    from regolithd.daemon.one_thread import compute_with_one_thread

    compute_with_one_thread()
    from regolithd.calibration.mismatch.errors import MismatchError
    from regolithd.daemon.mismatch.files import Outputs
    from regolithd.daemon.mismatch.result import comparison_result
    from regolithd.daemon.mismatch.run import run
    from regolithd.daemon.mismatch.traverse import extract_last_traverse
    from regolithd.daemon.setup import configuration_or_exit

    configuration = configuration_or_exit(config)
    try:
        files = extract_last_traverse(configuration.recording.directory)
        used = _simulation(configuration, config, simulation, files)
        answer = run([files.recording], used, Outputs(files.answer, files.report, files.corrected))
    except (MismatchError, OSError) as error:
        typer.echo(f"regolithd compare: {error}", err=True)
        raise typer.Exit(EXIT_DATA) from error
    typer.echo(f"report     {files.report}")
    if answer.effects or answer.changes:
        typer.echo(f"corrected  {files.corrected}")
        typer.echo("           Copy it to SIM.toml, beside rover.toml: the next traverse is compared with it.")
    if publish:
        _publish(configuration, comparison_result(answer, files, used))


def _simulation(configuration: Configuration, config: Path | None, given: Path | None, files: TraverseFiles) -> Path:
    """Return the path of SIM.toml: the given one, that beside rover.toml, or one made from rover.toml."""
    from regolithd.daemon.mismatch.traverse import simulation_toml

    beside = config.with_name("SIM.toml") if config is not None else None
    if given is not None:
        return given
    if beside is not None and beside.exists():
        return beside
    made = files.recording.with_suffix(".SIM.toml")
    made.write_text(simulation_toml(configuration), encoding="utf-8")
    return made


def _publish(configuration: Configuration, result: ComparisonResult) -> None:
    from regolithd.daemon.control.client import ControlError

    try:
        publish_result(configuration, result)
    except ControlError as error:
        typer.echo(f"not published: {error}", err=True)
        raise typer.Exit(EXIT_DAEMON) from error


def publish_result(configuration: Configuration, result: ComparisonResult) -> None:
    """Let the daemon publish a result: a second client of the rover would end the daemon's connection to the broker.

    Raises
    ------
    ControlError
        The daemon does not answer, or refuses it.
    """
    import asyncio

    from regolithd.daemon.control.client import ControlError, control_connection
    from regolithd.daemon.control.protocol import Done, PublishComparisonRequest

    async def publish() -> None:
        async with control_connection(configuration.control.socket) as daemon:
            daemon.send(PublishComparisonRequest(result=result))
            reply = await daemon.reply()
        if not isinstance(reply, Done):
            raise ControlError(f"The daemon refused it: {getattr(reply, 'text', reply)}", EXIT_DAEMON)

    asyncio.run(publish())
