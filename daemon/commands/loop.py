"""`regolithd loop`: conceal an effect, find it, correct the daemon, and see whether it reads the ground better."""

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
    seed: Annotated[int, typer.Option(min=0, help="of what is concealed, and of both drives")] = 1,
    out: Annotated[Path, typer.Option(help="recordings, simulations, configurations and the picture")] = Path(
        "build/loop"
    ),
    figures: Annotated[Path, typer.Option(help="the figures, one flat JSON object")] = Path("build/figures/loop.json"),
    picture: Annotated[Path | None, typer.Option(help="the picture; loop.svg in --out without it")] = None,
    case: Annotated[list[str] | None, typer.Option(help="coulomb, viscous or nothing alone")] = None,
    short: Annotated[bool, typer.Option("--short", help="short drives: to see that it runs")] = False,
) -> None:
    """Close the loop: a virtual rover with a concealed drivetrain effect, found, corrected, and driven elsewhere."""
    import json

    from rich.console import Console

    from regolithd.calibration.models import TERRAIN_MODEL
    from regolithd.daemon.closed_loop.case import cases
    from regolithd.daemon.closed_loop.close import Lengths, close
    from regolithd.daemon.closed_loop.picture import draw
    from regolithd.daemon.closed_loop.summary import figures_of, sentence
    from regolithd.daemon.pipeline.terrain_network import Network

    lengths = Lengths(first_s=400.0, second_s=180.0, stretch_m=1.1) if short else Lengths()
    chosen = [each for each in cases(seed) if not case or each.name in case]
    network = Network(TERRAIN_MODEL)
    console = Console()
    done = []
    with Console(stderr=True).status("") as status:
        for each in chosen:
            say = partial(_say, status, each.title)
            done.append(close(each, seed, out / each.name, network, lengths, say))
            console.print(sentence(done[-1]), highlight=False, soft_wrap=True)
    figures.parent.mkdir(parents=True, exist_ok=True)
    figures.write_text(json.dumps({"seed": seed, **figures_of(done)}, indent=1) + "\n", encoding="utf-8")
    drawn = picture or out / "loop.svg"
    draw(done, drawn)
    console.print(
        f"Picture: {drawn}; figures: {figures}; reports: {out}/*/comparison/*.html", highlight=False, soft_wrap=True
    )


def _say(status: Status, title: str, doing: str) -> None:
    status.update(f"{title}: the rover {doing}")
