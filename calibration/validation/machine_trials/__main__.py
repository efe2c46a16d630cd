"""`python -m regolithd.calibration.validation.machine_trials`: make cases, let the solver answer, print the score."""

from __future__ import annotations

import argparse
import json
import math
import secrets
import shutil
from pathlib import Path

from rich.console import Console

from regolithd.calibration.validation.blind_trials.errors import ProofError
from regolithd.calibration.validation.blind_trials.isolation import describe
from regolithd.calibration.validation.machine_trials.batch import SOLVER, Batch, run_batch
from regolithd.calibration.validation.machine_trials.cases.plan import KINDS, plan_batch
from regolithd.calibration.validation.machine_trials.machines import MACHINES
from regolithd.calibration.validation.machine_trials.score import Figures, Verdict, figures, judge
from regolithd.calibration.validation.machine_trials.table import line, score_table, shares_table

WIDTH = 110
"""Columns that the tables need."""


def options() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=300, help="how many cases")
    parser.add_argument("--seed", type=int, default=None, help="seed; left out, one that nobody knows yet")
    parser.add_argument("--machine", choices=list(MACHINES), help="this machine alone")
    parser.add_argument("--kind", choices=KINDS, help="this kind of case alone")
    parser.add_argument("--index", type=int, help="with --machine and --kind: this one case again")
    parser.add_argument("--out", type=Path, help="the batch's folder; an interrupted batch goes on")
    parser.add_argument("--solver", default=SOLVER, help="another solver, with {recording}, {simulation} and {answer}")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds for one answer")
    parser.add_argument("--keep", action="store_true", help="keep the recordings")
    parser.add_argument("--figures", type=Path, default=Path("build/figures/prove-machines.json"))
    return parser.parse_args()


def main() -> int:
    """Run a batch; return the exit status."""
    wanted, console = options(), Console(width=max(WIDTH, Console().width))
    seed = secrets.randbits(63) if wanted.seed is None else wanted.seed
    plans = plan_batch(seed, wanted.cases, wanted.machine, wanted.kind, wanted.index)
    folder = wanted.out or Path("build/prove-machines") / str(seed)
    batch = Batch(folder, tuple(plans), wanted.solver, wanted.keep, wanted.timeout)
    console.print(f"seed {seed}; {describe()}.", highlight=False)
    if shutil.which("cc") is None:
        console.print("no C compiler: the FMU of the oven cannot be built", style="red")
        return 1
    try:
        verdicts = [told(console, judge(outcome)) for outcome in run_batch(batch)]
    except ProofError as error:
        console.print(f"[red]{error}[/]", highlight=False)
        return 1
    report(console, figures(verdicts), wanted.figures)
    return 0


def told(console: Console, verdict: Verdict) -> Verdict:
    """Print one case and return it."""
    console.print(line(verdict), style="green" if verdict.right else "", highlight=False, soft_wrap=True)
    return verdict


def report(console: Console, score: Figures, path: Path) -> None:
    """Print the tables and write the flat figures."""
    console.print(score_table(score))
    console.print(shares_table(score))
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in score.items()}
    path.write_text(json.dumps(plain, indent=1) + "\n")


if __name__ == "__main__":
    raise SystemExit(main())
