"""`regolithd loop`: hide a drivetrain effect in a virtual rover, find it, correct `rover.toml`, compare estimates."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.status import Status


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("loop")(loop)


def loop(
    seed: Annotated[int, typer.Option(min=0, help="Seed of the hidden effect's size and of both drives.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for recordings, simulations, configurations and picture.")] = Path(
        "build/loop"
    ),
    figures: Annotated[Path, typer.Option(help="Write the figures here, as one JSON object.")] = Path(
        "build/figures/loop.json"
    ),
    picture: Annotated[Path | None, typer.Option(help="Draw the picture here (default: loop.svg in --out).")] = None,
    case: Annotated[list[str] | None, typer.Option(help="Only this case: coulomb, viscous or nothing.")] = None,
    short: Annotated[bool, typer.Option("--short", help="Short drives: a test run.")] = False,
) -> None:
    """Run the closed-loop study: hide a drivetrain effect, find it, correct rover.toml, compare the soil estimates.

    A virtual rover drives on a known soil; `regolithd mismatch` names what its simulation leaves out; the corrected
    configuration is tested on other soils. Takes some minutes.
    """
    import json

    from regolithd.calibration.models import TERRAIN_MODEL
    from regolithd.daemon.closed_loop.case import cases
    from regolithd.daemon.closed_loop.picture import draw
    from regolithd.daemon.closed_loop.run import DriveLengths, run_case
    from regolithd.daemon.closed_loop.summary import figures_of, sentence
    from regolithd.daemon.pipeline.terrain_network import TerrainNetwork
    from regolithd.daemon.terminal import terminal

    lengths = DriveLengths(first_s=400.0, second_s=180.0, stretch_m=1.1) if short else DriveLengths()
    chosen = [each for each in cases(seed) if not case or each.name in case]
    network = TerrainNetwork(TERRAIN_MODEL)
    console = terminal()
    done = []
    with terminal(stderr=True).status("") as status:
        for each in chosen:
            show = partial(_show, status, each.title)
            done.append(run_case(each, seed, out / each.name, network, lengths, show))
            console.print(sentence(done[-1]), highlight=False, soft_wrap=True)
    figures.parent.mkdir(parents=True, exist_ok=True)
    figures.write_text(json.dumps({"seed": seed, **figures_of(done)}, indent=1) + "\n", encoding="utf-8")
    drawn = picture or out / "loop.svg"
    draw(done, drawn)
    console.print(
        f"Picture: {drawn}; figures: {figures}; reports: {out}/*/comparison/*.html", highlight=False, soft_wrap=True
    )


def _show(status: Status, title: str, step: str) -> None:
    status.update(f"{title}: {step}")
