"""`regolithd demo`: run virtual rover, daemon and broker together for half a minute."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SETTLE_S = 4.0
"""Left out of the means after each change of soil: the smoothing filter's step response."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("demo")(demo)


def demo(
    out: Annotated[Path, typer.Option(help="Folder for recording, log and picture.")] = Path("build/demo"),
    seconds: Annotated[float, typer.Option(min=5, max=600, help="Duration of the drive in s.")] = 30.0,
) -> None:
    """Run a virtual rover, the daemon and an MQTT broker in one process, and show the estimates live.

    Needs no hardware and no root. At its end it prints estimated and true soil, and writes recording, log and picture.
    """
    import asyncio
    from importlib.util import find_spec

    from rich.console import Console

    if missing := [name for name in ("amqtt", "matplotlib") if find_spec(name) is None]:
        typer.echo(f"the demo needs {' and '.join(missing)}: pip install 'regolithd[demo]', or `make demo`", err=True)
        raise typer.Exit(1)

    from regolithd.daemon.demo.ground_truth_log import posteriors_on_soils, wheels_on_soils
    from regolithd.daemon.demo.picture import draw
    from regolithd.daemon.demo.result_tables import posterior_table, wheel_table
    from regolithd.daemon.demo.run import run_demo
    from regolithd.daemon.demo.screen import screen

    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    with screen(console, seconds) as show:
        done = asyncio.run(run_demo(out, seconds, show))
    records = done.ground_truth.records
    console.print(wheel_table(wheels_on_soils(records, settle_s=SETTLE_S)))
    console.print(posterior_table(posteriors_on_soils(records)))
    picture = out / "drive.png"
    draw(records, picture)
    for what, path in (("recording", done.recording), ("frames", done.log), ("picture", picture)):
        console.print(f"{what:10} {path}", highlight=False, soft_wrap=True)
