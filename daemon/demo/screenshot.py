"""The demo's live screen as the README's picture: `python -m regolithd.daemon.demo.screenshot docs/demo.svg`."""

from __future__ import annotations

import asyncio
import io
import re
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from regolithd.daemon.demo.drive import drive
from regolithd.daemon.demo.screen import frame

if TYPE_CHECKING:
    from rich.console import RenderableType

    from regolithd.daemon.demo.viewer import Viewer

SECONDS = 30.0
AT_S = 20.0
COLUMNS = 84


def photograph(to: Path) -> None:
    """Drive the demo, and write its screen of one moment as an SVG that fetches nothing."""
    seen: list[RenderableType] = []

    def show(viewer: Viewer, elapsed: float) -> None:
        if elapsed >= AT_S and not seen:
            seen.append(frame(viewer, elapsed, SECONDS))

    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(drive(Path(folder), SECONDS, show))
    console = Console(record=True, width=COLUMNS, force_terminal=True, file=io.StringIO())
    console.print(seen[0])
    svg = console.export_svg(title="make demo")
    to.write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    photograph(Path(sys.argv[1]))
