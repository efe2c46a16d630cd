"""What the thresholds of the mismatch engine cost: each one halved and doubled, on blind trials.

    python -m regolithd.calibration.validation.blind_trials.thresholds --seed 1 --recordings 40

Prints a Markdown table: every threshold with its value, meaning and source, and three scores for half its value and for
twice: the share of exact answers, of recordings without an effect that get a name, and of out-of-library effects that
are found as unexplained. The first row has the values in use. Results are kept in `--out`; an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
import tomllib
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch import MismatchError, compare, load_simulation, read_recording
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Threshold, Thresholds
from regolithd.calibration.validation.blind_trials.batch import Outcome, truth_of
from regolithd.calibration.validation.blind_trials.recordings.files import write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial, plan_batch
from regolithd.calibration.validation.blind_trials.score import figures, judge

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

FACTORS = (0.5, 2.0)
SCORES = ("exact_set", "false_name_on_nothing", "outside_unexplained_and_located")
HEADER = "| threshold | value | exact: ½, 2 | a name on nothing: ½, 2 | out of library found: ½, 2 | meaning | found |"


@dataclass(frozen=True)
class Study:
    """A batch of trials, and where its recordings and results are kept.

    Attributes
    ----------
    folder: holds trials/NNNN/ and results/THRESHOLD/FACTOR/NNNN.json
    seed, recordings: of the batch
    duration_s: length of each recording
    """

    folder: Path
    seed: int
    recordings: int
    duration_s: float = 1800.0

    def plans(self) -> list[Plan]:
        """Return what each recording conceals; constant speeds are left out, as they are scored by sets."""
        return [plan for plan in plan_batch(self.seed, self.recordings) if plan.group != "constant"]


def changed(name: str, factor: float, thresholds: Thresholds = THRESHOLDS) -> Thresholds:
    """Return thresholds with one multiplied; a whole number stays one, and at least 1."""
    before = getattr(thresholds, name)
    after = max(1, round(factor * before)) if isinstance(before, int) else factor * before
    return replace(thresholds, **{name: after})


def score_of(study: Study, name: str, factor: float, workers: Executor) -> dict[str, float]:
    """Return the scores of all trials with one threshold multiplied by a factor."""
    outcomes = workers.map(partial(_outcome, study, name, factor), study.plans())
    found = figures([judge(outcome) for outcome in outcomes])
    return {score: float(found[score]) for score in SCORES}


def _outcome(study: Study, name: str, factor: float, plan: Plan) -> Outcome:
    """Answer one trial, or read the answer that an earlier run left."""
    folder = study.folder / "trials" / f"{plan.number:04d}"
    truth = folder / "truth.json"
    result = study.folder / "results" / (name or "in-use") / f"{factor:g}" / f"{plan.number:04d}.json"
    if not result.exists():
        if not truth.exists():
            trial = make_trial(plan, duration_s=study.duration_s)
            write_trial(trial, folder)
            truth.write_text(json.dumps(truth_of(trial, {})))
        result.parent.mkdir(parents=True, exist_ok=True)
        result.write_text(json.dumps(_answer(folder, changed(name, factor) if name else THRESHOLDS)))
    return Outcome(plan.number, json.loads(truth.read_text()), json.loads(result.read_text()), {})


def _answer(folder: Path, thresholds: Thresholds) -> dict[str, object]:
    """Compare a trial's recording with its simulation."""
    started = time.perf_counter()
    simulation = load_simulation(tomllib.loads((folder / "SIM.toml").read_text()))
    try:
        found = compare(read_recording(folder / "recording.csv.gz"), simulation, thresholds=thresholds)
    except MismatchError as error:
        return {"seconds": time.perf_counter() - started, "answer": {"failed": str(error)}}
    return {"seconds": time.perf_counter() - started, "answer": found.answer.to_json()}


def rows(study: Study, thresholds: Sequence[Threshold], workers: Executor) -> Iterator[str]:
    """Yield the table's lines as they are found."""
    yield HEADER
    yield "|---" * HEADER.count(" | ") + "|---|"
    in_use = score_of(study, "", 1.0, workers)
    yield f"| in use | | {' | '.join(_percent(in_use[score]) for score in SCORES)} | | |"
    for one in thresholds:
        scores = [score_of(study, one.name, factor, workers) for factor in FACTORS]
        cells = (", ".join(_percent(found[score]) for found in scores) for score in SCORES)
        yield f"| `{one.name}` | {one.value:g} | {' | '.join(cells)} | {one.meaning} | {one.found} |"


def _percent(share: float) -> str:
    return "–" if math.isnan(share) else f"{100 * share:.0f} %"


def chosen(names: Iterable[str]) -> list[Threshold]:
    """Return these thresholds, or all where none is named.

    Raises
    ------
    ValueError
        When there is no threshold of a name.
    """
    table, wanted = THRESHOLDS.table(), set(names)
    if unknown := wanted - {one.name for one in table}:
        raise ValueError(f"there is no threshold {', '.join(sorted(unknown))}")
    return [one for one in table if not wanted or one.name in wanted]


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(description="Halve and double each threshold of the mismatch engine.")
    parser.add_argument("--seed", type=int, required=True, help="seed of the batch of blind trials")
    parser.add_argument("--recordings", type=int, default=40, help="recordings in the batch")
    parser.add_argument("--duration", type=float, default=1800.0, help="length of each recording [s]")
    parser.add_argument("--only", nargs="*", default=[], help="names of thresholds; left out: all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="comparisons at a time")
    parser.add_argument("--out", type=Path, default=Path("build/thresholds"), help="folder of the results")
    given = parser.parse_args(arguments)
    name = f"{given.seed}-{given.recordings}-{given.duration:g}"
    study = Study(given.out / name, given.seed, given.recordings, given.duration)
    with ProcessPoolExecutor(given.jobs) as workers:
        for row in rows(study, chosen(given.only), workers):
            print(row, flush=True)  # noqa: T201  # a command's output


if __name__ == "__main__":
    main()
