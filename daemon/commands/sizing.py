"""`regolithd sizing`: repeat the paper's study of the number of hidden neurons."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("sizing")(sizing)


def sizing(
    out: Annotated[Path, typer.Option(help="Write the figures here, as one JSON object.")] = Path(
        "build/figures/sizing.json"
    ),
    log: Annotated[Path, typer.Option(help="Log of finished trainings (JSON lines).")] = Path(
        "build/sizing/outcomes.jsonl"
    ),
    trainings: Annotated[int, typer.Option(min=2, help="Trainings of each size.")] = 100,
    epochs: Annotated[int, typer.Option(min=1, help="Maximum number of epochs of one training.")] = 10_000,
    timing_epochs: Annotated[int, typer.Option(min=1, help="Epochs of the comparison with scikit-learn.")] = 1000,
) -> None:
    """Repeat the paper's sizing study: mean MSE against the number of hidden neurons.

    An interrupted study is continued from its log. At its end the training speed is compared with scikit-learn's.
    """
    import json
    import time

    import numpy as np
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from regolithd.calibration.paper import sizing as study_of
    from regolithd.calibration.paper.sizing_speed import compare_speed, figures
    from regolithd.calibration.paper.training_set import training_set
    from regolithd.calibration.parameters import Drivetrain, Wheel

    study = study_of.Study(trainings=trainings, epochs=epochs)
    pairs = training_set(Drivetrain(), Wheel(), np.random.default_rng(study.seed))
    try:
        outcomes = study_of.resume(log, study)
    except study_of.DifferentStudyError as error:
        typer.echo(error, err=True)
        raise typer.Exit(1) from error
    resumed, start = len(outcomes), time.perf_counter()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    try:
        with Progress(*columns, TimeRemainingColumn()) as progress:
            task = progress.add_task("training", total=len(study.sizes) * trainings, completed=resumed)
            for outcome in study_of.run(study, pairs, outcomes, log, study_of.cores()):
                outcomes.append(outcome)
                progress.update(task, advance=1, description=f"3:{outcome.neurons}:2")
    except KeyboardInterrupt:
        typer.echo(f"Interrupted; finished trainings are in {log}. Run the command again to continue.", err=True)
        raise typer.Exit(130) from None
    seconds = time.perf_counter() - start
    typer.echo("comparing training speed with scikit-learn …")
    speed = compare_speed(pairs, log.parent, timing_epochs)
    best = study_of.best_size(outcomes)
    found = figures(study, outcomes, speed)
    found |= {"seconds_this_run": seconds, "trainings_this_run": len(outcomes) - resumed}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    typer.echo(f"lowest mean MSE: {best.mean_mse:.4f} ± {best.standard_error:.4f} at {best.neurons} neurons")
    typer.echo(
        f"scikit-learn takes {speed.ratio:.0f} times as long ({speed.ratio_one_core:.0f} on one core). Wrote {out}."
    )
