"""Print the live table: redrawn in place on a terminal, every 5 s where the output is not a terminal."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import Console, RenderableType

    from regolithd.daemon.demo.live_table import LiveTable

TITLE = "regolithd · a virtual rover on an in-process CAN bus, seen over MQTT"
PLAIN_EVERY_S = 5.0


@contextmanager
def screen(console: Console, seconds: float) -> Iterator[Callable[[LiveTable, float], None]]:
    """Yield a function that shows the table at an elapsed time [s]; the run takes `seconds`."""
    if not console.is_terminal:
        yield _plain(console, seconds)
        return
    with Live(Text(TITLE, style="bold"), console=console, auto_refresh=False) as live:
        yield lambda table, elapsed: live.update(frame(table, elapsed, seconds), refresh=True)


def frame(table: LiveTable, elapsed: float, seconds: float) -> RenderableType:
    """Return title, progress bar and table."""
    progress = Table.grid(padding=(0, 2))
    bar = ProgressBar(total=seconds, completed=elapsed, width=40)
    progress.add_row(Text("driving", style="dim"), bar, Text(f"{elapsed:.0f} of {seconds:.0f} s", style="dim"))
    return Group(Text(TITLE, style="bold"), Text(), progress, table.render())


def _plain(console: Console, seconds: float) -> Callable[[LiveTable, float], None]:
    console.print(TITLE)
    due = PLAIN_EVERY_S

    def show(table: LiveTable, elapsed: float) -> None:
        nonlocal due
        if elapsed < due:
            return
        due += PLAIN_EVERY_S
        console.print(f"\n{elapsed:.0f} of {seconds:.0f} s")
        console.print(table.render())

    return show
