"""Opens a file for reading with a progress bar on the terminal; without a terminal, no bar is shown."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

from rich.markup import escape
from rich.progress import open as open_with_bar

from regolithd.daemon.terminal import terminal

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path


def open_text(path: Path) -> AbstractContextManager[IO[str]]:
    """Open a text file with a progress bar."""
    console = terminal(stderr=True)
    return open_with_bar(
        path,
        "r",
        encoding="ascii",
        errors="replace",
        description=escape(path.name),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def open_binary(path: Path) -> AbstractContextManager[IO[bytes]]:
    """Open a binary file with a progress bar."""
    console = terminal(stderr=True)
    return open_with_bar(
        path, "rb", description=escape(path.name), console=console, transient=True, disable=not console.is_terminal
    )
