"""`regolithd demo`: see it work, with nothing but this computer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(help="Watch a virtual rover's wheels feel the ground: half a minute, no hardware, no root.")(demo)


def demo(
    out: Annotated[Path, typer.Option(help="where recording and picture go")] = Path("build/demo"),
    seconds: Annotated[float, typer.Option(min=5, max=600, help="how long to drive")] = 30.0,
) -> None:
    """Drive, show, summarise."""
    import asyncio
    from importlib.util import find_spec

    from rich.console import Console

    if missing := [name for name in ("amqtt", "matplotlib") if find_spec(name) is None]:
        typer.echo(f"the demo needs {' and '.join(missing)}: pip install 'regolithd[demo]', or `make demo`", err=True)
        raise typer.Exit(1)

    from regolithd.daemon.demo.drive import drive
    from regolithd.daemon.demo.ground_truth_log import grounds, stretches
    from regolithd.daemon.demo.picture import draw
    from regolithd.daemon.demo.screen import screen
    from regolithd.daemon.demo.summary import ground_summary, summary

    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    with screen(console, seconds) as show:
        driven = asyncio.run(drive(out, seconds, show))
    console.print(summary(stretches(driven.witness.seen, settle_s=4.0)))
    console.print(ground_summary(grounds(driven.witness.seen)))
    picture = out / "drive.png"
    draw(driven.witness.seen, picture)
    for what, path in (("recording", driven.recording), ("frames", driven.log), ("picture", picture)):
        console.print(f"{what:10} {path}", highlight=False, soft_wrap=True)
