"""F1 of localisation and bias of the parameters where laws fail in regions, beside LISDD.

python -m regolithd.calibration.validation.region_study build/figures/regions.json docs/pictures/regions.svg --seeds 8
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from regolithd.calibration.validation.region_study.machines import MACHINES, Case, Group, case_of
from regolithd.calibration.validation.region_study.picture import picture
from regolithd.calibration.validation.region_study.score import METHODS, Score, scores_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

GROUPS: tuple[Group, ...] = ("none", "everywhere", "one", "two")
"""Regions in which the law fails; "everywhere": over the whole of a covariate, smoothly."""


def cases(seeds: int) -> Iterator[Case]:
    """Yield every machine with each number of regions, in white and in correlated noise."""
    for seed in range(seeds):
        for machine in MACHINES:
            for group in GROUPS:
                for correlated in (False, True):
                    yield case_of(machine, seed, group, correlated=correlated)


def bias(scores: Sequence[Score]) -> float:
    """Return the magnitude of the mean relative error of a parameter over the cases, mean over all parameters."""
    found = []
    for machine in {score.machine for score in scores}:
        errors = np.array([score.errors for score in scores if score.machine == machine])
        found += np.abs(errors.mean(axis=0)).tolist()
    return float(np.mean(found))


def error(scores: Sequence[Score]) -> float:
    """Return the mean magnitude of the relative errors."""
    return float(np.mean([abs(each) for score in scores for each in score.errors]))


def figures_of(scores: Sequence[Score]) -> dict[str, float]:
    """Return the figures as one flat object."""
    figures: dict[str, float] = {}
    failing = [score for score in scores if score.group in {"one", "two"}]
    for method in METHODS:
        own = [score for score in failing if score.method == method]
        key = method.replace(" ", "_")
        figures |= {f"{key}_f1": _f1(own), f"{key}_bias": bias(own), f"{key}_error": error(own), "cases": len(own)}
        none = [score for score in scores if score.method == method and score.group == "none"]
        figures[f"{key}_false_regions"] = sum(score.told for score in none)
        figures["cases_none"] = len(none)
        smooth = [score for score in scores if score.method == method and score.group == "everywhere"]
        figures[f"{key}_ranges_of_smooth_laws"] = sum(score.told for score in smooth)
        figures["cases_everywhere"] = len(smooth)
    held = np.sum([score.bounds_held for score in failing], axis=0)
    return figures | {"bounds_held": float(held[0]), "bounds": float(held[1])}


def table(scores: Sequence[Score]) -> Table:
    """Return the table of F1, bias and error of each method."""
    shown = Table("regions", "noise", "method", "cases", "F1", "bias", "error")
    for group, correlated, method in product(("one", "two"), (False, True), METHODS):
        own = [each for each in scores if (each.group, each.correlated, each.method) == (group, correlated, method)]
        numbers = (str(len(own)), f"{_f1(own):.3f}", f"{bias(own):.4f}", f"{error(own):.4f}")
        shown.add_row(group, "correlated" if correlated else "white", method, *numbers)
    return shown


def _f1(scores: Sequence[Score]) -> float:
    return float(np.mean([score.f1 for score in scores]))


def main() -> None:
    """Run the cases, print the table, and write figures and picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figures", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--seeds", type=int, default=8, help="cases of each machine, number of regions and noise")
    chosen = parser.parse_args()
    scores = [score for case in track([*cases(chosen.seeds)], "comparing") for score in scores_of(case)]
    figures = figures_of(scores)
    console = Console()
    console.print(table(scores))
    for name, value in figures.items():
        console.print(f"{name}: {value:.4g}")
    chosen.figures.parent.mkdir(parents=True, exist_ok=True)
    chosen.figures.write_text(json.dumps(figures, indent=1) + "\n")
    chosen.picture.write_text(picture([score for score in scores if score.group in {"one", "two"}]))


if __name__ == "__main__":
    main()
