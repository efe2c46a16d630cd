"""The command line `regolithd`: one sub-command for each module of `daemon.commands`."""

from __future__ import annotations

import atexit
import importlib
import os
import pkgutil
import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

from regolithd.daemon import commands
from regolithd.daemon.terminal import HELP_MARKUP

app = typer.Typer(
    name="regolithd",
    help="Acquire, estimate and publish the terrain under a six-wheel rover; name the physics a simulation leaves out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=HELP_MARKUP,
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
    """Run the command line.

    The process ends after the functions that Python runs at exit, without those that libraries in C++ run later: now
    and then Apache Arrow aborts while it destroys the threads that read a file (apache/arrow issue 34314), and a
    command that had done its work would end with the exit code of SIGABRT.
    """
    ended: list[SystemExit] = []
    atexit.register(_end, ended)  # the last one to run: those that commands register come before the first
    try:
        app()
    except SystemExit as end:
        ended.append(end)
        raise


def _end(ended: list[SystemExit]) -> None:
    """End the process with the exit code of `SystemExit`; a text, which Python has printed by now, stands for 1."""
    if not ended:
        return  # a traceback or a signal, which Python turns into an exit code
    code = ended[0].code
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # nobody reads the pipe any more
            code = code or 1
    os._exit(code if isinstance(code, int) else int(code is not None))
