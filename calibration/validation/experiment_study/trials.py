"""One trial: a recording at one speed, the answer to it, the three experiments, and the answers to them.

The solver gets files in a folder of its own and runs apart from the truth, as in `regolithd prove`. Finished trials are
kept as TRIAL.json in the study's folder, and an interrupted study continues.
"""

from __future__ import annotations

import json
import shlex
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regolithd.calibration.validation.blind_trials.errors import OtherBatchError, SolverError
from regolithd.calibration.validation.blind_trials.isolation import run_isolated
from regolithd.calibration.validation.experiment_study.choices import CHOICES, Choice, experiments
from regolithd.calibration.validation.experiment_study.subjects import LENGTH_S

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from collections.abc import Set as AbstractSet

    from regolithd.calibration.validation.blind_trials.recordings.generator import Plan
    from regolithd.calibration.validation.blind_trials.recordings.traverse import ProposedExperiment
    from regolithd.calibration.validation.experiment_study.subjects import Subject

SOLVER = f"{shlex.quote(sys.executable)} -m regolithd.calibration.validation.experiment_study.solver"
"""A command that is given `answer` or `names` and folders, and writes answer.json into each."""
TEMPERATURE = "temperature"
CONSTANT_FORMS = {"cold-lubricant-friction": ("coulomb-friction", "viscous-friction")}
"""What a law is where its covariate, the temperature, does not vary: nothing tells it from that form there."""
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


def run_trial(plan: Plan, subject: Subject, folder: Path, solver: str = SOLVER, length_s: float = LENGTH_S) -> Trial:
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
        if (known["seed"], known["name"], known["subject"]) != (plan.seed, name, subject.name):
            raise OtherBatchError(f"{folder} holds the trials of another seed or machine")
        return _trial(plan, known["undecided"], known["results"])

    def solved(driven: Sequence[ProposedExperiment | None]) -> list[dict[str, Any]]:
        # All last equally long, whatever was proposed.
        writers = [partial(_write, subject, plan, each, length_s) for each in driven]
        return _solved(writers, "names" if any(driven) else "answer", solver)

    (first,) = solved([None])
    chosen = experiments(first["answer"], plan, subject)
    told = solved([*chosen.values()]) if chosen else []
    results: dict[str, Any] = {
        choice: {
            "right": [effect["name"] for effect in found["answer"]["effects"]] == [name],
            "margin": margin_of(found["scores"], name, remaining(first["answer"]), subject.steady - experiment.vary),
            "varied": sorted(experiment.vary),
            "lift": experiment.lift,
            "scores": found["scores"],
        }
        for (choice, experiment), found in zip(chosen.items(), told, strict=True)
    }
    folder.mkdir(parents=True, exist_ok=True)
    known = {"seed": plan.seed, "name": name, "subject": subject.name, "undecided": bool(chosen), "results": results}
    kept.write_text(json.dumps({**known, "proposal": first["answer"]["indistinguishable"]}, indent=1) + "\n")
    return _trial(plan, known["undecided"], results)


def remaining(answer: Mapping[str, Any]) -> set[str]:
    """Return the names that may be right after the first drive: those named, and those of sets and other answers."""
    parts = (*answer["indistinguishable"], *answer.get("alternatives", ()))
    return {effect["name"] for effect in answer["effects"]} | {name for part in parts for name in part["effects"]}


def margin_of(
    scores: Mapping[str, float], name: str, possible: AbstractSet[str], constant: AbstractSet[str] = frozenset()
) -> float:
    """Return the evidence for the concealed effect less that for the best other one.

    A law that an experiment did not test, as its covariate was `constant` or the solver did not look for it, is there
    what it is at a constant covariate: it has the evidence of that form.
    """
    found = dict(scores)
    for law, forms in CONSTANT_FORMS.items():
        if law in {name, *possible} and (law not in found or TEMPERATURE in constant):
            found[law] = max(scores.get(form, 0.0) for form in forms)
    return found.get(name, 0.0) - max((score for other, score in found.items() if other != name), default=0.0)


def _write(subject: Subject, plan: Plan, experiment: ProposedExperiment | None, length_s: float, folder: Path) -> None:
    subject.write(plan, experiment, folder, length_s)


def _solved(writers: Sequence[Callable[[Path], None]], asked: str, solver: str) -> list[dict[str, Any]]:
    """Return the solver's answers to recordings, each written into a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        names = [str(place) for place in range(len(writers))]
        for name, write in zip(names, writers, strict=True):
            write(Path(folder) / name)
        run_isolated([*shlex.split(solver), asked, *names], Path(folder), threads=1, timeout_s=TIMEOUT_S)
        try:
            return [json.loads((Path(folder) / name / "answer.json").read_text()) for name in names]
        except (OSError, json.JSONDecodeError) as error:
            raise SolverError(f"the solver wrote no answer: {error}") from error


def _trial(plan: Plan, undecided: bool, results: dict[str, Any]) -> Trial:  # as it is stored
    known = {choice: results[choice] for choice in CHOICES if choice in results}
    made = {
        choice: Result(one["right"], one["margin"], tuple(one["varied"]), one["lift"]) for choice, one in known.items()
    }
    return Trial(plan.number, plan.names[0], undecided, made)
