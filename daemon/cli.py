"""`regolithd`: finds the commands and hands over."""

from __future__ import annotations

import importlib
import pkgutil

import typer

from regolithd.daemon import commands

app = typer.Typer(
    name="regolithd",
    help="Feels the ground through a rover's motors, and finds the physics that a simulation leaves out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback()
def _commands() -> None:
    """Make each command a word of its own, even while there is only one."""


for module in pkgutil.iter_modules(commands.__path__):
    importlib.import_module(f"regolithd.daemon.commands.{module.name}").register(app)


def main() -> None:
    """Run the command line."""
    app()
