"""Print the live table: redrawn in place on a terminal, every 5 s where the output is not a terminal."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from regolithd.daemon.demo.run import Show

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console, RenderableType

    from regolithd.daemon.demo.live_table import LiveTable

TITLE = "regolithd · a virtual rover drives from firm into weak soil, seen over MQTT"
COMPUTING = "computing the drive before, without waiting"
PLAIN_EVERY_S = 10.0


@contextmanager
def screen(console: Console, seconds: float, *, paper: bool = False) -> Iterator[Show]:
    """Yield what shows the computed part and the table at an elapsed time [s]; the live part takes `seconds`."""
    if not console.is_terminal:
        yield _plain(console, seconds, paper=paper)
        return
    with Live(Text(TITLE, style="bold"), console=console, auto_refresh=False) as live:

        def driving(table: LiveTable, elapsed: float) -> None:
            table.paper = paper
            live.update(frame(table, elapsed, seconds), refresh=True)

        yield Show(lambda done, all_s: live.update(computing(done, all_s), refresh=True), driving)


def computing(done_s: float, all_s: float) -> RenderableType:
    """Return title and progress of the part that is computed."""
    return Group(Text(TITLE, style="bold"), Text(), _progress(COMPUTING, done_s, all_s, "min", 60))


def frame(table: LiveTable, elapsed: float, seconds: float) -> RenderableType:
    """Return title, progress bar and table."""
    return Group(Text(TITLE, style="bold"), Text(), _progress("driving", elapsed, seconds, "s", 1), table.render())


def _progress(what: str, done: float, total: float, unit: str, divisor: float) -> Table:
    progress = Table.grid(padding=(0, 2))
    bar = ProgressBar(total=total, completed=done, width=24)
    text = f"{done / divisor:.0f} of {total / divisor:.0f} {unit}"
    progress.add_row(Text(what, style="dim"), bar, Text(text, style="dim"))
    return progress


def _plain(console: Console, seconds: float, *, paper: bool) -> Show:
    console.print(TITLE)
    due = PLAIN_EVERY_S
    announced = False

    def computed(_done_s: float, all_s: float) -> None:
        nonlocal announced
        if not announced:
            announced = True
            console.print(f"{COMPUTING}: {all_s / 60:.0f} min")

    def show(table: LiveTable, elapsed: float) -> None:
        nonlocal due
        table.paper = paper
        if elapsed < due:
            return
        due += PLAIN_EVERY_S
        console.print(f"\n{elapsed:.0f} of {seconds:.0f} s")
        console.print(table.render())

    return Show(computed, show)
