"""The terminal that commands print to: each text as it is, since in `[mqtt] port` nothing is markup of Rich."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import typer

if TYPE_CHECKING:
    from rich.console import Console

HELP_MARKUP: Final = "markdown"
"""What help texts are written in, as the documentation's page of commands is; in Rich's markup `[mqtt]` is a style."""


def finite(value: float) -> float:
    """Return an option's number; used as its callback, since Python reads `nan` and `inf` as numbers."""
    if not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not finite. Give a number.")
    return value


def terminal(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a console that takes no text for markup or emoji. Styles are given by `rich.text.Text` and `style`."""
    from rich.console import Console  # noqa: PLC0415  # every command imports this module, and few print tables

    return Console(stderr=stderr, quiet=quiet, markup=False, emoji=False)
