"""`regolithd train-posterior`: train the posterior network on simulated rovers and write it as ONNX."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("train-posterior")(train_posterior)


def train_posterior(
    out: Annotated[Path, typer.Option(help="Write the network here (ONNX).")] = Path(
        "calibration/models/posterior.onnx"
    ),
    rovers: Annotated[int, typer.Option(min=1000, help="Number of simulated windows.")] = 1_500_000,
    steps: Annotated[int, typer.Option(min=50, help="Number of optimiser steps (Adam).")] = 40_000,
    seed: Annotated[int, typer.Option(help="Seed of rovers and initial weights.")] = 1,
) -> None:
    """Train the posterior network on simulated rovers, and write it as ONNX. Takes some minutes on two cores."""
    import numpy as np
    from rich.progress import Progress

    from regolithd.calibration.models.digest import with_digest
    from regolithd.calibration.parameters import Wheel
    from regolithd.calibration.posterior.onnx_export import export_onnx
    from regolithd.calibration.posterior.training import fit
    from regolithd.calibration.posterior.training_examples import simulate_examples

    with Progress() as progress:
        simulating = progress.add_task("simulating rovers", total=rovers)
        examples = simulate_examples(
            rovers, np.random.default_rng(seed), lambda done: progress.advance(simulating, done)
        )
        fitting = progress.add_task("fitting", total=steps)

        def show(loss: float) -> None:
            progress.update(fitting, advance=50, description=f"fitting, loss {loss:.3f}")

        parameters, standardisation = fit(examples, seed, steps, progress=show)
    out.parent.mkdir(parents=True, exist_ok=True)
    model = export_onnx(parameters, standardisation, Wheel().radius_m)
    out.write_bytes(with_digest(model.SerializeToString()))
    typer.echo(f"Wrote {out}.")
