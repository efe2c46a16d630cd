"""`regolithd status`: show the state of the running daemon and its nodes."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from regolithd.daemon.control.protocol import Status


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("status")(status)


def status(
    *,
    config: Annotated[Path | None, typer.Option(help="The rover.toml of the running daemon.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print the daemon's answer as JSON.")] = False,
) -> None:
    """Show the running daemon's nodes, broker connection and traverse.

    Exit status: 0 if every node is operational, else 1.
    """
    from regolithd.daemon.control.client import run_client

    raise typer.Exit(run_client(config, lambda path: _status(path, as_json=json)))


async def _status(path: Path, *, as_json: bool) -> int:
    from regolithd.daemon.control.client import control_connection
    from regolithd.daemon.control.protocol import Status, StatusRequest
    from regolithd.daemon.terminal import terminal

    async with control_connection(path) as daemon:
        daemon.send(StatusRequest())
        reply = await daemon.reply()
    if not isinstance(reply, Status):
        typer.echo(f"Unexpected answer of the daemon: {reply}", err=True)
        return 1
    if as_json:
        typer.echo(reply.model_dump_json(indent=2))
    else:
        console = terminal()
        console.print(_head(reply))
        console.print(_table(reply))
    return int(not reply.nodes or any(node.phase != "operational" for node in reply.nodes))


def _head(status: Status) -> Text:
    from rich.text import Text

    driven = status.traverse
    traverse = "none" if driven is None else f"{driven.turned_m:.3f} m turned, {driven.elapsed_s:.1f} s"
    return Text.assemble(
        (status.rover, "bold"),
        f" · bus {status.bus} · broker {status.broker} · "
        f"{status.snapshots} snapshots at {status.rate_Hz:g} Hz · traverse: {traverse}",
    )


def _table(status: Status) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table("node", "kind", "wheel", "phase", "drive", "problem", box=box.SIMPLE_HEAD, expand=True)
    colours = {"operational": "green", "booting": "yellow"}
    for node in status.nodes:
        colour = colours.get(node.phase, "red")
        wheel = "" if node.wheel is None else str(node.wheel)
        phase = Text(node.phase, style=colour)
        table.add_row(
            str(node.node_id), node.kind, wheel, phase, node.drive_state or "", "" if colour == "green" else node.text
        )
    return table
