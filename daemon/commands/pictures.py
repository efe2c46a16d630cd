"""`regolithd pictures`: what `regolithd evaluate` found, drawn for `docs/`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(help="Draw what `regolithd evaluate` found, for docs/.")(pictures)


def pictures(
    figures: Annotated[Path, typer.Option(help="what `regolithd evaluate` found")] = Path(
        "build/figures/evaluate.json"
    ),
    details: Annotated[Path, typer.Option(help="its ranks and delays")] = Path("build/evaluate.npz"),
    docs: Annotated[Path, typer.Option(help="where the pictures go")] = Path("docs"),
) -> None:
    """Draw errors, calibration, one sample, the alarm and the drivetrain."""
    import json

    import numpy as np

    from regolithd.calibration.posterior.estimator import PosteriorEstimator
    from regolithd.calibration.validation.estimators import pictures as draw

    if not (figures.is_file() and details.is_file()):
        typer.echo(f"{figures} is not there: run `regolithd evaluate` first", err=True)
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
