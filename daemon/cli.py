"""The command line `regolithd`: one sub-command for each module of `daemon.commands`."""

from __future__ import annotations

import importlib
import pkgutil
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

from regolithd.daemon import commands

app = typer.Typer(
    name="regolithd",
    help="Acquire, estimate and publish the terrain under a six-wheel rover; name the physics a simulation leaves out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    """Print the installed version and exit."""
    if wanted:
        try:
            typer.echo(f"regolithd {version('regolithd')}")
        except PackageNotFoundError:
            typer.echo("regolithd, not installed: run from a checkout")
        raise typer.Exit


@app.callback()
def _options(
    *,
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Define the options before the sub-command."""


for module in pkgutil.iter_modules(commands.__path__):
    importlib.import_module(f"regolithd.daemon.commands.{module.name}").register(app)


def main() -> None:
    """Run the command line."""
    app()
