"""The study from the command line: a table, figures as JSON, and a picture.

python -m regolithd.calibration.validation.experiment_study build/figures docs --machine rover
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
from regolithd.calibration.validation.experiment_study.subjects import SUBJECTS
from regolithd.calibration.validation.experiment_study.trials import run_trial


def table(figures: dict[str, float]) -> Table:
    """Return what each choice led to, and how the proposed one compares."""
    shown = Table("choice", "right name", "median Δχ²", "quartiles", "proposed has the larger", "by, median")
    for choice in CHOICES:
        key = choice.replace("-", "_")
        right = f"{figures[f'{key}_right']:.0f} of {figures['driven']:.0f}"
        quartiles = " to ".join(f"{figures[f'{key}_margin_{which}_quartile']:.1f}" for which in ("lower", "upper"))
        share = _with_interval(figures, f"win_share_against_{key}", 100, "{:.0f}")
        shown.add_row(
            choice,
            right,
            f"{figures[f'{key}_margin_median']:.1f}",
            quartiles,
            share and f"{share} %",
            _with_interval(figures, f"ahead_of_{key}", 1, "{:.1f}"),
        )
    return shown


def _with_interval(figures: dict[str, float], key: str, factor: float, form: str) -> str:
    """Return a figure with its 90 % interval; nothing where there is none."""
    if key not in figures:
        return ""
    value, low, high = (form.format(factor * figures[key + end]) for end in ("", "_low", "_high"))
    return f"{value} ({low} to {high})"


def main() -> None:
    """Run the trials, print the table, and write figures and picture."""
    parser = argparse.ArgumentParser(prog="regolithd.calibration.validation.experiment_study")
    parser.add_argument("figures", type=Path, help="folder for experiments-MACHINE.json")
    parser.add_argument("pictures", type=Path, help="folder for experiments-MACHINE.svg")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20, help="recordings at one speed (20)")
    parser.add_argument("--machine", choices=SUBJECTS, default="rover")
    parser.add_argument("--folder", type=Path, default=None, help="of finished trials (build/experiments/MACHINE/SEED)")
    asked = parser.parse_args()
    folder = asked.folder or Path("build/experiments") / asked.machine / str(asked.seed)
    trials = [
        run_trial(plan, SUBJECTS[asked.machine], folder) for plan in track(plans(asked.seed, asked.count), "driving")
    ]
    figures = figures_of(trials)
    console = Console()
    if figures["driven"]:
        console.print(table(figures))
    for name, value in figures.items():
        console.print(f"{name}: {value:.4g}")
    for folder in (asked.figures, asked.pictures):
        folder.mkdir(parents=True, exist_ok=True)
    (asked.figures / f"experiments-{asked.machine}.json").write_text(json.dumps(figures, indent=1) + "\n")
    (asked.pictures / f"experiments-{asked.machine}.svg").write_text(picture(trials))


if __name__ == "__main__":
    main()
