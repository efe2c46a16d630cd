"""`regolithd evaluate`: how good the estimators and the alarm are, as figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(help="Test posterior, paper's network, least squares and alarm on rovers that none has seen.")(evaluate)


def evaluate(
    out: Annotated[Path, typer.Option(help="the figures, one flat JSON object")] = Path("build/figures/evaluate.json"),
    details: Annotated[Path, typer.Option(help="ranks and delays, for the pictures")] = Path("build/evaluate.npz"),
    rovers: Annotated[int, typer.Option(min=100, help="rovers on held-out soils")] = 10_000,
    drives: Annotated[int, typer.Option(min=10, help="drives that the alarm is tested on")] = 400,
    hours: Annotated[float, typer.Option(min=0.1, help="of each drive over one soil")] = 1.0,
    seed: Annotated[int, typer.Option(help="never one that training used")] = 20_261_121,
) -> None:
    """Ask everything of everybody, and write it down."""
    import json
    import math

    import numpy as np
    from rich.progress import Progress

    from calibration.evaluation import detector, drivetrain, estimators
    from calibration.posterior import Estimator

    estimator = Estimator()
    found: dict[str, float] = {"rovers": rovers}
    kept: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]] = {}
    with Progress() as progress:
        task = progress.add_task("estimators", total=len(estimators.CASES) + 1)
        for name, case in estimators.CASES.items():
            answers = estimators.answers(rovers, case, seed, estimator)
            found |= estimators.figures(answers, f"{name}_")
            kept |= {f"{name}_ranks": answers.ranks, f"{name}_truth": answers.truth}
            kept |= {f"{name}_{method}": answer for method, answer in answers.methods.items()}
            progress.advance(task)
        found |= drivetrain.figures(min(rovers, 4000), seed + 1, estimator)
        progress.advance(task)
        half_seconds = 2 * round(hours * 7200) * drives
        task = progress.add_task("alarm", total=half_seconds)
        figures, delays = detector.figures(drives, hours, seed + 2, lambda done: progress.advance(task, done))
    found |= {f"alarm_{name}": value for name, value in figures.items()}
    kept |= {f"alarm_{name}": value for name, value in delays.items()}
    out.parent.mkdir(parents=True, exist_ok=True)
    # JSON has no infinity: a delay that never ended is null.
    flat = {name: value if math.isfinite(value) else None for name, value in found.items()}
    out.write_text(json.dumps(flat, indent=1) + "\n", encoding="utf-8")
    np.savez_compressed(details, **kept)  # type: ignore[arg-type]  # its stubs do not see the arrays as arrays
    for prefix in ("window_", "instant_"):
        for unit in ("cohesion_Pa", "friction_angle_deg"):
            ratio = found[f"{prefix}ratio_to_paper_{unit}"]
            typer.echo(f"{prefix}{unit}: {ratio:.2f} of the paper network's error")
    typer.echo(f"alarm after {found['alarm_cusum_delay_median_s']:.1f} s (median). Wrote {out}.")
