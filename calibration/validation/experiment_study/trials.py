"""One trial: a recording at one speed, the answer to it, the three experiments, and the answers to them.

The solver gets files in a folder of its own and runs apart from the truth, as in `regolithd prove`. Finished trials are
kept as TRIAL.json in the study's folder, and an interrupted study continues.
"""

from __future__ import annotations

import json
import shlex
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regolithd.calibration.validation.blind_trials.errors import OtherBatchError, SolverError
from regolithd.calibration.validation.blind_trials.isolation import run_isolated
from regolithd.calibration.validation.blind_trials.recordings.files import write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial
from regolithd.calibration.validation.experiment_study.choices import CHOICES, Choice, experiments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.blind_trials.recordings.traverse import ProposedExperiment

SOLVER = f"{shlex.quote(sys.executable)} -m regolithd.calibration.validation.experiment_study.solver"
"""A command that is given `answer` or `names` and folders, and writes answer.json into each."""
LENGTH_S, STEP_S = 1200.0, 0.5
"""Length of each recording and its step: a third of the usual evidence, so that an experiment matters (a choice)."""
TIMEOUT_S = 1800.0


@dataclass(frozen=True)
class Result:
    """What one choice led to.

    Attributes
    ----------
    right: whether the search in the experiment's recording decides on the concealed effect's name and no other
    margin: Δχ² of the concealed effect over the best other one, penalties included
    varied: the covariates that were varied
    lift: whether the wheels were lifted for a part
    """

    right: bool
    margin: float
    varied: tuple[str, ...]
    lift: bool


@dataclass(frozen=True)
class Trial:
    """A concealed effect, whether the first answer had a set that cannot be told apart, and what each choice led to."""

    number: int
    name: str
    undecided: bool
    results: dict[Choice, Result]


def run_trial(plan: Plan, folder: Path, solver: str = SOLVER, length_s: float = LENGTH_S) -> Trial:
    """Return a trial, from its file where it is finished.

    Raises
    ------
    OtherBatchError
        When the folder holds another seed's trials.
    """
    kept = folder / f"{plan.number:04d}.json"
    (name,) = plan.names
    if kept.exists():
        known = json.loads(kept.read_text())
        if (known["seed"], known["name"]) != (plan.seed, name):
            raise OtherBatchError(f"{folder} holds the trials of another seed")
        return _trial(plan, known["undecided"], known["results"])
    (first,) = _solved(plan, [None], solver, length_s)
    chosen = experiments(first["answer"], plan)
    # All last equally long, whatever was proposed.
    driven = [replace(experiment, duration_s=length_s) for experiment in chosen.values()]
    told = _solved(plan, driven, solver, length_s) if driven else []
    results: dict[str, Any] = {
        choice: {
            "right": [effect["name"] for effect in found["answer"]["effects"]] == [name],
            "margin": margin_of(found["scores"], name),
            "varied": sorted(experiment.vary),
            "lift": experiment.lift,
        }
        for (choice, experiment), found in zip(chosen.items(), told, strict=True)
    }
    folder.mkdir(parents=True, exist_ok=True)
    known = {"seed": plan.seed, "name": name, "undecided": bool(chosen), "results": results}
    kept.write_text(json.dumps({**known, "proposal": first["answer"]["indistinguishable"]}, indent=1) + "\n")
    return _trial(plan, known["undecided"], results)


def margin_of(scores: dict[str, float], name: str) -> float:
    """Return the evidence for the concealed effect less that for the best other one."""
    return scores.get(name, 0.0) - max((score for other, score in scores.items() if other != name), default=0.0)


def _solved(
    plan: Plan, driven: Sequence[ProposedExperiment | None], solver: str, length_s: float
) -> list[dict[str, Any]]:
    """Return the solver's answers to recordings of a rover: of experiments, or of the first drive where it is None."""
    with tempfile.TemporaryDirectory() as folder:
        names = [str(place) for place in range(len(driven))]
        for name, experiment in zip(names, driven, strict=True):
            trial = make_trial(plan, duration_s=length_s, step_s=STEP_S, experiment=experiment)
            write_trial(trial, Path(folder) / name)
        how = "names" if any(driven) else "answer"
        run_isolated([*shlex.split(solver), how, *names], Path(folder), threads=1, timeout_s=TIMEOUT_S)
        try:
            return [json.loads((Path(folder) / name / "answer.json").read_text()) for name in names]
        except (OSError, json.JSONDecodeError) as error:
            raise SolverError(f"the solver wrote no answer: {error}") from error


def _trial(plan: Plan, undecided: bool, results: dict[str, Any]) -> Trial:  # as it is stored
    known = {choice: results[choice] for choice in CHOICES if choice in results}
    made = {choice: Result(**{**one, "varied": tuple(one["varied"])}) for choice, one in known.items()}
    return Trial(plan.number, plan.names[0], undecided, made)
