"""Draw the demo's screen as an SVG, for the README.

python -m regolithd.daemon.demo.screenshot docs/pictures/demo.svg
"""

from __future__ import annotations

import asyncio
import io
import re
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from regolithd.daemon.demo.run import Show, run_demo
from regolithd.daemon.demo.screen import frame
from regolithd.daemon.demo.story import LIVE_S

if TYPE_CHECKING:
    from rich.console import RenderableType

    from regolithd.daemon.demo.live_table import LiveTable

ALARM_FROM_S, AT_S = 10.0, 36.0
"""The screen is drawn when the alarm is raised, at the latest after `AT_S`."""
COLUMNS = 84


def screenshot(to: Path) -> None:
    """Run the demo, and write its screen once the alarm is raised as an SVG without web fonts."""
    frames: list[RenderableType] = []

    def show(table: LiveTable, elapsed: float) -> None:
        if (table.alarms or elapsed >= AT_S) and elapsed >= ALARM_FROM_S and not frames:
            frames.append(frame(table, elapsed, LIVE_S))

    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(run_demo(Path(folder), LIVE_S, Show(lambda _done, _all: None, show)))
    console = Console(record=True, width=COLUMNS, force_terminal=True, file=io.StringIO())
    console.print(frames[0])
    svg = console.export_svg(title="make demo")
    to.write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    screenshot(Path(sys.argv[1]))
