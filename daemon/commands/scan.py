"""`regolithd scan`: list every node on the bus, and what each would need in `rover.toml`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from regolithd.daemon.check.scan import ScannedNode
    from regolithd.daemon.config.configuration import Configuration


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("scan")(scan)


def scan(
    *,
    config: Annotated[Path | None, typer.Option(help="The rover.toml whose bus and nodes are meant.")] = None,
    channel: Annotated[str | None, typer.Option(help="CAN interface, such as can0; default: [bus] channel.")] = None,
    interface: Annotated[str | None, typer.Option(help="python-can's name of the interface type.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List every node on the bus: identity, state, errors, and what it would need in rover.toml.

    Reads only, and resets nothing. Do not run it while a daemon boots nodes. Exit status: 1 if the bus cannot be used.
    """
    import asyncio
    from dataclasses import asdict
    from json import dumps

    from regolithd.daemon.check.scan import scan_bus
    from regolithd.daemon.setup import configuration_or_exit
    from regolithd.daemon.terminal import terminal
    from regolithd.drivers.errors import BusError

    configuration = _on(configuration_or_exit(config), interface, channel)
    try:
        with terminal(stderr=True, quiet=json).status("Asking 127 node-IDs …"):
            found = asyncio.run(scan_bus(configuration, known=config is not None))
    except (BusError, ExceptionGroup) as error:
        reason = error if isinstance(error, BusError) else error.exceptions[0]
        typer.echo(str(reason), err=True)
        raise typer.Exit(1) from error
    if json:
        typer.echo(dumps([asdict(each) for each in found], indent=2))
    else:
        terminal().print(_table(found) if found else "No node answers or sends on this bus.")


def _on(configuration: Configuration, interface: str | None, channel: str | None) -> Configuration:
    changes = {"interface": interface, "channel": channel}
    bus = configuration.bus.model_copy(update={name: value for name, value in changes.items() if value})
    return configuration.model_copy(update={"bus": bus})


def _table(found: list[ScannedNode]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table("node", "device", "identity", "state", "errors", "in rover.toml", box=box.SIMPLE_HEAD, expand=True)
    for each in found:
        cells = (str(each.node_id), each.device, each.identity, each.state, each.errors, each.needs)
        table.add_row(*cells)
    return table
