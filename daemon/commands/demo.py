"""`regolithd demo`: a virtual rover drives into weak soil; then its recording is compared with a simulation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from regolithd.daemon.demo.run import DemoRun

SETTLE_S = 4.0
"""Left out of the means after each change of soil: the smoothing filter's step response."""
PACKAGES = ("amqtt", "matplotlib", "jinja2", "scipy", "tomlkit")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("demo")(demo)


def demo(
    *,
    out: Annotated[Path, typer.Option(help="Folder for recording, log, picture and report.")] = Path("build/demo"),
    seconds: Annotated[float, typer.Option(min=5, max=600, help="Duration of the live drive in s.")] = 44.0,
    paper: Annotated[
        bool, typer.Option("--paper", help="Show the paper's network beside it, as a comparison.")
    ] = False,
    compare: Annotated[bool, typer.Option(help="Compare the recording with a simulation.")] = True,
) -> None:
    """Run a virtual rover, the daemon and an MQTT broker in one process, and show the estimates live.

    Needs no hardware and no root. A long drive on firm soil is computed without waiting; then the rover drives live
    onto weak soil, axle after axle. At the end the recording is compared with a simulation that lacks a drag which the
    virtual rover has.
    """
    import asyncio
    from importlib.util import find_spec

    if missing := [name for name in PACKAGES if find_spec(name) is None]:
        typer.echo(f"the demo needs {' and '.join(missing)}: pip install 'regolithd[demo]', or `make demo`", err=True)
        raise typer.Exit(1)

    from regolithd.daemon.demo.run import run_demo
    from regolithd.daemon.demo.screen import screen
    from regolithd.daemon.terminal import terminal

    console = terminal()
    out.mkdir(parents=True, exist_ok=True)
    with screen(console, seconds, paper=paper) as show:
        done = asyncio.run(run_demo(out, seconds, show))
    _results(console, done, out, paper=paper)
    if compare:
        _compare(console, done, out)


def _results(console: Console, done: DemoRun, out: Path, *, paper: bool) -> None:
    """Print when the axles crossed and the alarm came, and estimates beside the truth; write the picture."""
    from regolithd.daemon.demo.crossings import crossings
    from regolithd.daemon.demo.ground_truth_log import posteriors_on_soils, wheels_on_soils
    from regolithd.daemon.demo.picture import draw
    from regolithd.daemon.demo.result_tables import posterior_table, wheel_table

    records = done.ground_truth.records
    live = [record for record in records if record[0].snapshot.time_ns >= done.live_from_ns]
    for line in crossings(records, done.live_from_ns).lines:
        console.print(line, style="bold" if "alarm" in line else None, highlight=False)
    console.print(posterior_table(posteriors_on_soils(records)))
    if paper:
        console.print(wheel_table(wheels_on_soils(live, settle_s=SETTLE_S)))
    picture = out / "drive.png"
    draw(live, picture, paper=paper)
    for what, path in (("recording", done.recording), ("frames", done.log), ("picture", picture)):
        console.print(f"{what:10} {path}", highlight=False, soft_wrap=True)


def _compare(console: Console, done: DemoRun, out: Path) -> None:
    """Compare the recording with the simulation, and show the report where there is a screen."""
    import os

    from regolithd.daemon.demo.comparison import compare
    from regolithd.daemon.demo.run import demo_configuration
    from regolithd.daemon.demo.story import CONCEALED_A_S_PER_RAD

    console.print("\nThe recording is compared with a simulation that knows what the daemon was told of this rover:")
    try:
        report = compare(done.recording, demo_configuration(out, out, 1))
    except OSError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    console.print(
        f"concealed from both: viscous friction, {CONCEALED_A_S_PER_RAD:g} A s/rad on all wheels; and the second soil",
        highlight=False,
    )
    console.print(f"report     {report}", highlight=False, soft_wrap=True)
    if console.is_terminal and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        typer.launch(str(report))
