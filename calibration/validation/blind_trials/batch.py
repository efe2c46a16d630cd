"""A batch of blind trials: for each, write the files, commit to the truth, run the solver, open the commitment.

In the batch's folder:

    commitments.csv       number, digest, time: appended before the solver starts, never changed
    trials/NNNN/          the solver's input: recording.csv.gz and SIM.toml, nothing else
    answers/NNNN.json     the solver's answer and its duration
    baselines/NNNN.json   the baselines' answers to the same two files
    experiments/NNNN.json at constant speed: the answer after the experiment that the solver proposed
    opened/NNNN.json      salt and truth, written after the answer

An interrupted batch resumes: trials whose commitment is opened are not repeated. No file contains the seed, so opened
commitments reveal nothing about the others.
"""

from __future__ import annotations

import json
import shlex
import shutil
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.validation.blind_trials.commitment import Commitment, Truth, file_digest, read_opened
from regolithd.calibration.validation.blind_trials.errors import OtherBatchError, SolverError
from regolithd.calibration.validation.blind_trials.isolation import run_isolated
from regolithd.calibration.validation.blind_trials.recordings.files import write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, Trial, make_trial, plan_batch
from regolithd.calibration.validation.blind_trials.recordings.traverse import ProposedExperiment

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.calibration.validation.blind_trials.recordings.concealed_effect import ConcealedEffect

SOLVER = (
    f"{shlex.quote(sys.executable)} -m regolithd mismatch {{recording}} --simulation {{simulation}} --json {{answer}}"
)
BASELINES = (
    f"{shlex.quote(sys.executable)} -m regolithd.calibration.validation.blind_trials.baselines "
    "{recording} {simulation} {answer}"
)


@dataclass(frozen=True)
class Batch:
    """Settings of a batch; `solver` and `baselines` are commands with {recording}, {simulation}, {answer}."""

    folder: Path
    seed: int
    recordings: int = 200
    jobs: int = 1
    solver: str = SOLVER
    baselines: str | None = BASELINES
    keep: bool = False
    duration_s: float = 1800.0
    timeout_s: float = 600.0
    groups: tuple[str, ...] = ()
    _writing: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def plans(self) -> list[Plan]:
        """Return the plan of each recording; if `groups` is given, of those groups only."""
        return [p for p in plan_batch(self.seed, self.recordings) if not self.groups or p.group in self.groups]

    def path(self, kind: str, number: int, suffix: str = ".json") -> Path:
        """Return the path of a trial's file of this kind."""
        return self.folder / kind / f"{number:04d}{suffix}"


@dataclass(frozen=True)
class Outcome:
    """One trial after its commitment was opened: the truth, the answers of the solver and of the baselines."""

    number: int
    truth: Truth
    answer: dict[str, Any]
    baselines: dict[str, Any]
    experiment: dict[str, Any] | None = None
    """The solver's answer to a recording of the experiment that it proposed, if any."""


def truth_of(trial: Trial, files: dict[str, str]) -> Truth:
    """Return the truth of a trial; it has no seed, so that it reveals nothing about the other trials."""
    return {
        "number": trial.plan.number,
        "group": trial.plan.group,
        "drive": trial.traverse.kind,
        "effects": [
            {
                "name": effect.name,
                "kind": effect.kind,
                "strength": effect.strength,
                "wheels": list(effect.wheels),
                "covariate": effect.covariate,
                "channel": "motor_current_A" if effect.added_load_N is None else "load_N",
                "onset_s": effect.onset_s,
                "parameters": true_parameters(trial, effect),
            }
            for effect in trial.effects
        ],
        "duration_s": float(trial.traverse.t_s[-1]),
        "mean_current_A": trial.mean_current_A,
        "noise_A": trial.noise_A,
        "true_rmse_A": trial.true_rmse_A,
        "files_sha256": files,
    }


def true_parameters(trial: Trial, effect: ConcealedEffect) -> dict[str, float]:
    """Return the true values that intervals are compared with: those that do not depend on the form of a law.

    `relative_size` is the effect's root mean square on its wheels over the mean reading. Effects whose law has such a
    constant add an onset, a constant current, an offset, or an order.
    """
    moving = trial.traverse.moving
    on = moving & np.isin(np.arange(1, 7), effect.wheels)
    added = effect.added_current_A(effect.size)
    size = float(np.sqrt(np.mean(added[on] ** 2)) / np.mean(np.abs(trial.current_A[moving])))
    onset = {} if effect.onset_s is None else {"onset_s": effect.onset_s}
    return {"relative_size": size, **onset, **effect.parameters(effect.size)}


def solve(batch: Batch, command: str, kind: str, number: int) -> None:
    """Run a solver on one trial and write its answer; a failure is written as `failed` with its reason."""
    folder, answer = batch.path("trials", number, ""), batch.path(kind, number)
    output = folder / f"{kind}.json"
    filled = command.format(recording="recording.csv.gz", simulation="SIM.toml", answer=output.name)
    threads = 2 if batch.jobs == 1 else 1
    started = time.perf_counter()
    try:
        run_isolated(shlex.split(filled), folder, threads=threads, timeout_s=batch.timeout_s)
        content = json.loads(output.read_text())
    except (SolverError, OSError, json.JSONDecodeError) as error:
        content = {"failed": str(error)}
    answer.parent.mkdir(parents=True, exist_ok=True)
    answer.write_text(json.dumps({"seconds": time.perf_counter() - started, "answer": content}, indent=1) + "\n")
    output.unlink(missing_ok=True)


def commit(batch: Batch, number: int, digest: str) -> None:
    """Append the digest to `commitments.csv`; called before the solver starts."""
    with batch._writing, (batch.folder / "commitments.csv").open("a") as lines:  # noqa: SLF001  # its own lock
        lines.write(f"{number},{digest},{datetime.now(UTC).isoformat(timespec='seconds')}\n")


def run_trial(batch: Batch, plan: Plan) -> Outcome:
    """Generate, commit, solve, open, in this order."""
    if batch.path("opened", plan.number).exists():
        return reopened(batch, plan)
    trial = make_trial(plan, duration_s=batch.duration_s)
    paths = write_trial(trial, batch.path("trials", plan.number, ""))
    commitment = Commitment(truth_of(trial, {path.name: file_digest(path) for path in paths}))
    committed = commitment.digest
    commit(batch, plan.number, committed)
    del trial
    solve(batch, batch.solver, "answers", plan.number)
    if batch.baselines:
        solve(batch, batch.baselines, "baselines", plan.number)
    if plan.group == "constant":
        run_experiment(batch, plan)
    commitment.open_into(batch.path("opened", plan.number), committed)
    if not batch.keep:
        shutil.rmtree(batch.path("trials", plan.number, ""))
    return outcome(batch, plan.number)


def run_experiment(batch: Batch, plan: Plan) -> None:
    """Record the experiment that the answer proposes, and run the solver on it; the commitment is still closed."""
    answer = json.loads(batch.path("answers", plan.number).read_text())["answer"]
    proposed = ProposedExperiment.of_answer(answer)
    if proposed is None:
        return
    trial = make_trial(plan, duration_s=batch.duration_s, experiment=proposed)
    write_trial(trial, batch.path("trials", plan.number, ""))
    solve(batch, batch.solver, "experiments", plan.number)


def reopened(batch: Batch, plan: Plan) -> Outcome:
    """Return a trial that was finished earlier, after checking that it belongs to this batch."""
    done = outcome(batch, plan.number)
    if (done.truth["group"], [e["kind"] for e in done.truth["effects"]]) != (plan.group, list(plan.names)):
        raise OtherBatchError(f"{batch.folder} holds the answers to another seed's recordings")
    return done


def outcome(batch: Batch, number: int) -> Outcome:
    """Return a finished trial from its files, after verifying its commitment."""
    baselines, experiment = batch.path("baselines", number), batch.path("experiments", number)
    return Outcome(
        number=number,
        truth=read_opened(batch.path("opened", number)),
        answer=json.loads(batch.path("answers", number).read_text()),
        baselines=json.loads(baselines.read_text())["answer"] if baselines.exists() else {},
        experiment=json.loads(experiment.read_text())["answer"] if experiment.exists() else None,
    )


def run_batch(batch: Batch) -> Iterator[Outcome]:
    """Yield each trial as it finishes; up to `jobs` solvers run at a time."""
    batch.folder.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(batch.jobs) as workers:
        waiting = [workers.submit(run_trial, batch, plan) for plan in batch.plans()]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise
