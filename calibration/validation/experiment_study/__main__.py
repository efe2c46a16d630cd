"""The study from the command line: a table, figures as JSON, and a picture.

python -m regolithd.calibration.validation.experiment_study build/figures/experiments.json docs/experiments.svg
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

from regolithd.calibration.validation.experiment_study.choices import CHOICES, plans
from regolithd.calibration.validation.experiment_study.picture import picture
from regolithd.calibration.validation.experiment_study.score import figures_of
from regolithd.calibration.validation.experiment_study.trials import run_trial


def table(figures: dict[str, float]) -> Table:
    """Return what each choice led to, and how the proposed one compares."""
    shown = Table("choice", "right name", "median Δχ²", "mean Δχ²", "proposed is ahead", "ratio of means")
    for choice in CHOICES:
        key = choice.replace("-", "_")
        ahead = ratio = "–"
        if f"ratio_to_{key}" in figures:
            share, low, high = (100 * figures[f"win_share_against_{key}{end}"] for end in ("", "_low", "_high"))
            ahead = f"{share:.0f} % ({low:.0f} to {high:.0f})"
            ratio, low, high = (figures[f"ratio_to_{key}{end}"] for end in ("", "_low", "_high"))  # type: ignore[assignment]
            ratio = f"{ratio:.2f} ({low:.2f} to {high:.2f})"
        right = f"{figures[f'{key}_right']:.0f} of {figures['driven']:.0f}"
        shown.add_row(
            choice,
            right,
            f"{figures[f'{key}_margin_median']:.1f}",
            f"{figures[f'{key}_margin_mean']:.1f}",
            ahead,
            ratio,
        )
    return shown


def main() -> None:
    """Run the trials, print the table, and write figures and picture."""
    parser = argparse.ArgumentParser(prog="regolithd.calibration.validation.experiment_study")
    parser.add_argument("figures", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20, help="recordings at one speed (20)")
    parser.add_argument("--folder", type=Path, default=None, help="of finished trials (build/experiments/SEED)")
    asked = parser.parse_args()
    folder = asked.folder or Path("build/experiments") / str(asked.seed)
    trials = [run_trial(plan, folder) for plan in track(plans(asked.seed, asked.count), "driving")]
    figures = figures_of(trials)
    console = Console()
    if figures["driven"]:
        console.print(table(figures))
    for name, value in figures.items():
        console.print(f"{name}: {value:.4g}")
    asked.figures.parent.mkdir(parents=True, exist_ok=True)
    asked.figures.write_text(json.dumps(figures, indent=1) + "\n")
    asked.picture.write_text(picture(trials))


if __name__ == "__main__":
    main()
