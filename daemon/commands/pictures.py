"""`regolithd pictures`: draw the figures of `regolithd evaluate` for `docs/pictures/`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("pictures")(pictures)


def pictures(
    figures: Annotated[Path, typer.Option(help="Figures of `regolithd evaluate`.")] = Path(
        "build/figures/evaluate.json"
    ),
    details: Annotated[Path, typer.Option(help="Ranks and delays of `regolithd evaluate`.")] = Path(
        "build/evaluate.npz"
    ),
    docs: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("docs/pictures"),
) -> None:
    """Draw the figures of `regolithd evaluate`: errors, coverage, one sample, alarm delays, drivetrain."""
    import json

    import numpy as np

    from regolithd.calibration.posterior.estimator import PosteriorEstimator
    from regolithd.calibration.validation.estimators import pictures as draw

    if not (figures.is_file() and details.is_file()):
        typer.echo(f"{figures} does not exist: run `regolithd evaluate` first", err=True)
        raise typer.Exit(1)
    found = json.loads(figures.read_text(encoding="utf-8"))
    with np.load(details) as kept:
        delays = {name: kept[name] for name in kept.files if name.startswith("alarm_")}
        ranks = kept["window_ranks"]
    draw.errors(found, docs / "estimators.svg")
    draw.calibration(found, ranks, docs / "coverage.svg")
    draw.one_sample(PosteriorEstimator(), docs / "one-sample.png")
    draw.alarm(delays, docs / "alarm.svg")
    draw.drivetrain(found, docs / "drivetrain.svg")
    typer.echo(f"Wrote five pictures to {docs}.")
