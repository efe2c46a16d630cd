"""The terminal that commands print to: each text as it is, since in `[mqtt] port` nothing is markup of Rich."""

from __future__ import annotations

from typing import Final

from rich.console import Console

HELP_MARKUP: Final = "markdown"
"""What help texts are written in, as the documentation's page of commands is; in Rich's markup `[mqtt]` is a style."""


def terminal(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a console that takes no text for markup or emoji. Styles are given by `rich.text.Text` and `style`."""
    return Console(stderr=stderr, quiet=quiet, markup=False, emoji=False)
