"""`regolithd train`: train the paper's network and write it as ONNX."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("train")(train)


def train(
    out: Annotated[Path, typer.Option(help="Write the network here (ONNX).")] = Path("calibration/models/terrain.onnx"),
    config: Annotated[
        Path | None, typer.Option(help="TOML with the tables drivetrain and wheel; default: Kapvik.")
    ] = None,
    neurons: Annotated[int, typer.Option(min=1, help="Number of hidden neurons.")] = 64,
    trainings: Annotated[
        int, typer.Option(min=1, help="Number of trainings; the network with the lowest MSE is kept.")
    ] = 100,
    epochs: Annotated[int, typer.Option(min=1, help="Maximum number of epochs of one training.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Seed of pair order and initial weights.")] = 1,
) -> None:
    """Train the paper's network on its 504 input–output pairs, and write it as ONNX."""
    import tomllib

    import numpy as np
    from rich.progress import track

    from regolithd.calibration.models.digest import with_digest
    from regolithd.calibration.paper import backpropagation
    from regolithd.calibration.paper.onnx_export import export_onnx, model_card
    from regolithd.calibration.paper.training_set import training_set
    from regolithd.calibration.parameters import Drivetrain, Wheel

    tables = tomllib.loads(config.read_text(encoding="utf-8")) if config else {}
    drivetrain, wheel = Drivetrain(**tables.get("drivetrain", {})), Wheel(**tables.get("wheel", {}))
    pairs = training_set(drivetrain, wheel, np.random.default_rng(seed))
    seeds = np.random.SeedSequence(seed).spawn(trainings)
    done = [
        backpropagation.train(pairs, neurons, np.random.default_rng(each), epochs)
        for each in track(seeds, description=f"training 3:{neurons}:2")
    ]
    best = min(done, key=lambda training: training.mse)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(with_digest(export_onnx(best.perceptron, pairs).SerializeToString()))
    mean = float(np.mean([training.mse for training in done]))
    typer.echo(f"{model_card(best.perceptron, pairs).version}: MSE {best.mse:.4f} after {best.epochs} epochs")
    typer.echo(f"mean MSE of {trainings}: {mean:.4f} (the paper: 0.0251). Wrote {out}.")
