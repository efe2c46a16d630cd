"""`regolithd reproduce`: recompute the paper's figures and write the page that compares them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("reproduce")(reproduce)


def reproduce(
    docs: Annotated[
        Path, typer.Option(help="Folder of the documentation: the page goes to `results/`, its figures to `pictures/`.")
    ] = Path("docs"),
    figures: Annotated[Path, typer.Option(help="Write the figures here, as one JSON object.")] = Path(
        "build/figures/reproduce.json"
    ),
    sizing: Annotated[Path, typer.Option(help="Figures of `regolithd sizing`, if it has run.")] = Path(
        "build/figures/sizing.json"
    ),
    trainings: Annotated[int, typer.Option(min=2, help="Number of networks of the paper's size.")] = 20,
) -> None:
    """Recompute the paper's figures, and write the page docs/results/reproduction.md."""
    import json

    import numpy as np
    from rich.progress import Progress

    from regolithd.calibration.parameters import Drivetrain, Wheel
    from regolithd.calibration.validation.reproduction import page, pictures, published, recomputation
    from regolithd.calibration.validation.reproduction.scalings import scalings

    sized = json.loads(sizing.read_text(encoding="utf-8")) if sizing.is_file() else None
    with Progress() as progress:
        task = progress.add_task("training", total=trainings + 6 * max(2, trainings // 4))

        def tick() -> None:
            progress.advance(task)

        pairs, done = recomputation.trained(Drivetrain(), Wheel(), trainings, tick=tick)
        unpublished = recomputation.unpublished_constants(max(2, trainings // 4), tick)
    perceptron = min(done, key=lambda training: training.mse).perceptron
    traverses = [
        recomputation.traverse(perceptron, ground, np.random.default_rng(7)) for ground in published.COHESION_PA
    ]
    record = recomputation.record_500(done)
    noise_free = recomputation.current_sweep(perceptron, np.array([published.SET_500["motor_current_A"]]))[0]
    results = page.Results(
        trainings=trainings,
        loads=recomputation.load_ranges(pairs),
        scalings=scalings(pairs, perceptron(pairs.inputs)),
        record=record,
        unpublished=unpublished,
        traverses=traverses,
        noise_free=(float(noise_free[0]), float(noise_free[1])),
        sizing=sized,
    )
    written, drawn = docs / "results" / "reproduction.md", docs / "pictures"
    for folder in (written.parent, drawn):
        folder.mkdir(parents=True, exist_ok=True)
    written.write_text(page.page(results), encoding="utf-8")
    pictures.training_set(pairs, drawn / "training-set.svg")
    pictures.traverse(traverses, drawn / "traverse.svg")
    if sized:
        pictures.sizing(sized, drawn / "sizing.svg")
    figures.parent.mkdir(parents=True, exist_ok=True)
    figures.write_text(json.dumps(page.figures(results), indent=1) + "\n", encoding="utf-8")
    typer.echo(f"record 500: c {record.cohesion_Pa:.0f} Pa (paper 3352), φ {record.angle_deg:.1f}° (28.6)")
    typer.echo(f"Wrote {written}.")
