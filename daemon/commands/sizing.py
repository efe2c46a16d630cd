"""`regolithd sizing`: the paper's study of the network's size, all of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(help="Run the paper's sizing study; interrupt it and it goes on from there.")(sizing)


def sizing(
    out: Annotated[Path, typer.Option(help="the figures, one flat JSON object")] = Path("build/figures/sizing.json"),
    log: Annotated[Path, typer.Option(help="what is done so far")] = Path("build/sizing/outcomes.jsonl"),
    trainings: Annotated[int, typer.Option(min=2, help="of each size")] = 100,
    epochs: Annotated[int, typer.Option(min=1, help="the most epochs of one training")] = 10_000,
    timing_epochs: Annotated[int, typer.Option(min=1, help="epochs timed, ours and scikit-learn's")] = 1000,
) -> None:
    """Train, log, summarise, and time a slice of it against scikit-learn."""
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
        typer.echo(f"stopped; {log} holds what is done. Run it again to go on.", err=True)
        raise typer.Exit(130) from None
    seconds = time.perf_counter() - start
    typer.echo("timing a slice against scikit-learn …")
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
