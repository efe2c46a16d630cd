"""`regolithd prove`: blind trials of `regolithd mismatch` on simulated recordings with hidden effects."""

from __future__ import annotations

import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regolithd.daemon.terminal import finite

if TYPE_CHECKING:
    from rich.console import Console

    from regolithd.calibration.validation.blind_trials.batch import Batch, Outcome
    from regolithd.calibration.validation.blind_trials.score import Figures


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("prove")(prove)


def prove(  # each is an option of the command line
    recordings: Annotated[int, typer.Option(help="Number of recordings.")] = 200,
    seed: Annotated[int | None, typer.Option(help="Seed of the batch; a random one if left out.")] = None,
    out: Annotated[Path, typer.Option(help="Folder of the batch; an interrupted batch is continued.")] = Path(
        "build/prove"
    ),
    jobs: Annotated[int, typer.Option(help="Number of parallel processes; 0: one per core.")] = 0,
    solver: Annotated[
        str, typer.Option(help="Command of another solver, with {recording}, {simulation}, {answer}.")
    ] = "",
    group: Annotated[
        list[str] | None, typer.Option(help="Only this group: nothing, single, pair, outside, constant.")
    ] = None,
    no_baselines: Annotated[bool, typer.Option("--no-baselines", help="Do not run the baselines.")] = False,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the recordings.")] = False,
    duration: Annotated[float, typer.Option(callback=finite, help="Duration of each recording in s.")] = 1800.0,
    figures: Annotated[Path | None, typer.Option(help="Also write the score here, as one JSON object.")] = None,
) -> None:
    """Run blind trials of `regolithd mismatch`: recordings with hidden effects, scored beside four baselines.

    A digest of each ground truth is written before its recording is analysed, so that the score can be verified.
    """
    from regolithd.calibration.validation.blind_trials.batch import BASELINES, SOLVER, Batch
    from regolithd.calibration.validation.blind_trials.errors import ProofError
    from regolithd.calibration.validation.blind_trials.isolation import describe
    from regolithd.daemon.terminal import terminal

    console = terminal()
    drawn = secrets.randbits(63) if seed is None else seed
    batch = Batch(
        folder=out,
        seed=drawn,
        recordings=recordings,
        jobs=jobs or os.cpu_count() or 1,
        solver=solver or SOLVER,
        baselines=None if no_baselines else BASELINES,
        keep=keep,
        duration_s=duration,
        groups=tuple(group or ()),
    )
    console.print(f"seed {drawn}; {describe()}.", highlight=False)
    console.print(
        f"A digest of each ground truth is written to {out / 'commitments.csv'} before its solver starts.",
        highlight=False,
    )
    try:
        outcomes = _run(batch, console)
    except ProofError as error:
        console.print(str(error), style="red", highlight=False)
        raise typer.Exit(1) from error
    _report(outcomes, console, [out / "score.json", *([figures] if figures else [])])


def _run(batch: Batch, console: Console) -> list[Outcome]:
    """Run the batch under a progress bar that shows the running score."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from regolithd.calibration.validation.blind_trials.batch import run_batch
    from regolithd.calibration.validation.blind_trials.score import judge

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    outcomes: list[Outcome] = []
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("prove", total=len(batch.plans()))
        right = 0
        for outcome in run_batch(batch):
            outcomes.append(outcome)
            right += judge(outcome).right
            progress.update(task, advance=1, description=f"prove: {right} of {len(outcomes)} right")
    return sorted(outcomes, key=lambda outcome: outcome.number)


def _report(outcomes: list[Outcome], console: Console, paths: list[Path]) -> Figures:
    """Print the tables and write the flat figures."""
    import json
    import math

    from regolithd.calibration.validation.blind_trials.score import figures_of
    from regolithd.calibration.validation.blind_trials.table import baselines_table, score_table

    figures = figures_of(outcomes)
    console.print(score_table(figures))
    if any(key.startswith("peer_") for key in figures):
        console.print(baselines_table(figures))
    known = {key: None if math.isnan(float(value)) else value for key, value in figures.items()}
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(known, indent=1) + "\n")
    return figures
