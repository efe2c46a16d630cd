"""`regolithd evaluate`: errors and coverage of the soil estimators, delays of the soil-change alarm."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regolithd.daemon.terminal import finite

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Part(StrEnum):
    """A part of the evaluation."""

    ALL = "all"
    ESTIMATORS = "estimators"
    ALARM = "alarm"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("evaluate")(evaluate)


def evaluate(
    out: Annotated[Path, typer.Option(help="Write the figures here, as one JSON object.")] = Path(
        "build/figures/evaluate.json"
    ),
    details: Annotated[Path, typer.Option(help="Write ranks and delays here, for `regolithd pictures`.")] = Path(
        "build/evaluate.npz"
    ),
    rovers: Annotated[int, typer.Option(min=100, help="Number of simulated rovers on held-out soils.")] = 10_000,
    drives: Annotated[int, typer.Option(min=10, help="Number of drives for the alarm.")] = 400,
    hours: Annotated[
        float, typer.Option(min=0.1, callback=finite, help="Duration of each drive over one soil in h.")
    ] = 1.0,
    part: Annotated[Part, typer.Option(help="Evaluate only this part; the other's figures are kept.")] = Part.ALL,
    seed: Annotated[int, typer.Option(help="Seed; must differ from the training's.")] = 31_907_442,
) -> None:
    """Evaluate posterior, paper's network, least squares and soil-change alarm on simulated rovers.

    The rovers and soils were not used in training. Writes figures (JSON) and ranks and delays (NPZ).
    """
    import json
    import math

    import numpy as np
    from rich.progress import Progress

    from regolithd.calibration.posterior.estimator import PosteriorEstimator
    from regolithd.calibration.validation.estimators import bias, change_detector, drivetrain, errors_and_coverage

    found: dict[str, float | None] = json.loads(out.read_text(encoding="utf-8")) if out.is_file() else {}
    kept: dict[str, Array] = dict(np.load(details)) if details.is_file() else {}
    with Progress() as progress:
        if part != Part.ALARM:
            estimator = PosteriorEstimator()
            task = progress.add_task("estimators", total=len(errors_and_coverage.CASES) + 1)
            for name, case in errors_and_coverage.CASES.items():
                estimates = errors_and_coverage.estimate_all(rovers, case, seed, estimator)
                found |= errors_and_coverage.figures(estimates, f"{name}_")
                kept |= {f"{name}_ranks": estimates.ranks}
                progress.advance(task)
            found["rovers"] = rovers
            found |= drivetrain.figures(min(rovers, 4000), seed + 1, estimator)
            found |= bias.figures(2000, seed + 3, estimator)
            progress.advance(task)
        if part != Part.ESTIMATORS:
            task = progress.add_task("alarm", total=len(change_detector.CASES) * round(hours * 7200) * drives)
            figures, delays = change_detector.figures(
                drives, hours, seed + 2, lambda done: progress.advance(task, done)
            )
            found |= {f"alarm_{name}": value for name, value in figures.items()}
            kept |= {f"alarm_{name}": value for name, value in delays.items()}
    out.parent.mkdir(parents=True, exist_ok=True)
    # JSON has no infinity: a delay that never ended is null.
    flat = {name: value if value is not None and math.isfinite(value) else None for name, value in found.items()}
    out.write_text(json.dumps(flat, indent=1) + "\n", encoding="utf-8")
    np.savez_compressed(details, allow_pickle=False, **kept)
    for name in ("window_ratio_to_paper_cohesion_Pa", "window_ratio_to_paper_friction_angle_deg"):
        if name in flat:
            typer.echo(f"{name}: {flat[name]:.2f}")
    if "alarm_cusum_delay_median_s" in flat:
        typer.echo(f"alarm after {flat['alarm_cusum_delay_median_s']} s (median)")
    typer.echo(f"Wrote {out}.")
