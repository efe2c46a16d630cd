"""`regolithd traverse`: drive a distance at constant wheel speed; `regolithd stop`: stop the wheels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regolithd.daemon.terminal import finite

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from regolithd.daemon.control.client import ControlConnection
    from regolithd.daemon.control.protocol import Ended, Refused

Config = Annotated[Path | None, typer.Option(help="The rover.toml of the running daemon.")]
INTERRUPTED = 130


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("traverse")(traverse)
    app.command("stop")(stop)


def traverse(
    *,
    distance: Annotated[float, typer.Option(callback=finite, help="Distance of the wheels' rims in m.")],
    speed: Annotated[
        float, typer.Option(callback=finite, help="Speed of the wheels' rims in m/s; negative: backwards.")
    ] = 0.022,
    config: Config = None,
) -> None:
    """Drive a distance at constant wheel speed through the running daemon, then stop with the drives' ramp.

    Ctrl-C, a lost node, or any other end of this command quick-stops the wheels.
    """
    from regolithd.daemon.control.client import run_client

    raise typer.Exit(run_client(config, lambda path: _traverse(path, distance, speed)))


async def _traverse(path: Path, distance_m: float, speed_m_s: float) -> int:
    import asyncio
    import signal

    from regolithd.daemon.control.client import control_connection
    from regolithd.daemon.control.protocol import Refused, StopRequest, TraverseRequest

    interrupted = False

    def interrupt() -> None:
        nonlocal interrupted
        if interrupted:  # a second Ctrl-C ends at once; the daemon quick-stops then too
            raise SystemExit(INTERRUPTED)
        interrupted = True
        daemon.send(StopRequest(quick=True))

    async with control_connection(path) as daemon:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGTSTP):
            asyncio.get_running_loop().add_signal_handler(number, interrupt)
        daemon.send(TraverseRequest(distance_m=distance_m, speed_m_s=speed_m_s))
        end = await _follow(daemon)
    if isinstance(end, Refused):
        typer.echo(f"Not driven: {end.text} {end.remedy}".rstrip(), err=True)
        return 1
    typer.echo(f"{end.ending.value.capitalize()} after {end.elapsed_s:.3f} s, {end.turned_m:.3f} m turned: {end.text}.")
    if end.ending == "finished":
        return 0
    return INTERRUPTED if interrupted else 1


async def _follow(daemon: ControlConnection) -> Ended | Refused:
    """Show the progress until the traverse has ended or was refused."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from regolithd.daemon.control.protocol import Ended, Refused

    columns = (
        TextColumn("[bold]traverse"),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[turned_m]:7.3f} m"),
        TextColumn("{task.completed:6.1f} of {task.total:.1f} s"),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, expand=True) as bar:
        while True:
            reply = await daemon.reply()
            if isinstance(reply, Ended | Refused):
                if isinstance(reply, Ended):
                    for task in bar.task_ids:
                        bar.update(task, completed=reply.elapsed_s, turned_m=reply.turned_m)
                return reply
            _show(bar, reply)


def _show(bar: Bar, reply: object) -> None:
    from regolithd.daemon.control.protocol import Accepted, Progress

    if isinstance(reply, Accepted):
        bar.add_task("traverse", total=reply.duration_s, turned_m=0.0)
    elif isinstance(reply, Progress):
        for task in bar.task_ids:
            bar.update(task, completed=reply.elapsed_s, turned_m=reply.turned_m)


def stop(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="Quick stop instead of the drives' ramp.")] = False,
    config: Config = None,
) -> None:
    """Stop the wheels, also those of a traverse that another user commanded."""
    from regolithd.daemon.control.client import run_client

    raise typer.Exit(run_client(config, lambda path: _stop(path, quick=quick)))


async def _stop(path: Path, *, quick: bool) -> int:
    from regolithd.daemon.control.client import control_connection
    from regolithd.daemon.control.protocol import Done, StopRequest

    async with control_connection(path) as daemon:
        daemon.send(StopRequest(quick=quick))
        reply = await daemon.reply()
    if isinstance(reply, Done):
        typer.echo(reply.text)
        return 0
    typer.echo(f"Not stopped: {getattr(reply, 'text', reply)} {getattr(reply, 'remedy', '')}".rstrip(), err=True)
    return 1
