"""A batch: for each trial make the files, commit to the truth, let the solver answer, open the envelope.

In the batch's folder:

    commitments.csv     number, digest, when: appended before the solver is started, never changed
    trials/NNN/         what the solver is given: recording.csv.gz and SIM.toml, nothing else
    answers/NNN.json    what it said, and in how many seconds
    peers/NNN.json      what the peers said of the same two files
    experiments/NNN.json  where one speed could tell nothing: what it said after the experiment that it proposed
    opened/NNN.json     salt and truth, written after the answer

A batch that was interrupted goes on where it stopped: what has an answer and an opened envelope is not done again. No
file tells the seed, so an opened envelope says nothing of those still sealed.
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

from regolithd.calibration.validation.blind_trials.commitment import Envelope, Truth, file_digest, read_opened
from regolithd.calibration.validation.blind_trials.errors import OtherBatchError, SolverError
from regolithd.calibration.validation.blind_trials.files import write_trial
from regolithd.calibration.validation.blind_trials.generator import Plan, Trial, make_trial, plan_batch
from regolithd.calibration.validation.blind_trials.isolation import run_alone

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.calibration.validation.blind_trials.scene import Concealed

SOLVER = (
    f"{shlex.quote(sys.executable)} -m regolithd mismatch {{recording}} --simulation {{simulation}} --json {{answer}}"
)
PEERS = (
    f"{shlex.quote(sys.executable)} -m regolithd.calibration.validation.blind_trials.baselines "
    "{recording} {simulation} {answer}"
)


@dataclass(frozen=True)
class Batch:
    """What to do, where, and with whom; `solver` and `peers` are commands with {recording}, {simulation}, {answer}."""

    folder: Path
    seed: int
    recordings: int = 200
    jobs: int = 1
    solver: str = SOLVER
    peers: str | None = PEERS
    keep: bool = False
    duration_s: float = 1800.0
    timeout_s: float = 600.0
    groups: tuple[str, ...] = ()
    _writing: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def plans(self) -> list[Plan]:
        """Return what each recording of the batch conceals; of the wanted groups alone, if any are wanted."""
        return [p for p in plan_batch(self.seed, self.recordings) if not self.groups or p.group in self.groups]

    def path(self, kind: str, number: int, suffix: str = ".json") -> Path:
        """Return where a trial's file of this kind is."""
        return self.folder / kind / f"{number:04d}{suffix}"


@dataclass(frozen=True)
class Outcome:
    """One trial after its envelope was opened: the truth, the solver's answer and the peers' names."""

    number: int
    truth: Truth
    answer: dict[str, Any]
    peers: dict[str, Any]
    experiment: dict[str, Any] | None = None
    """What the solver says after its own experiment was driven, where it proposed one."""


def truth_of(trial: Trial, files: dict[str, str]) -> Truth:
    """Return what the envelope holds: no seed, so that it tells nothing of the other trials."""
    return {
        "number": trial.plan.number,
        "group": trial.plan.group,
        "drive": trial.drive.kind,
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
        "duration_s": float(trial.drive.t_s[-1]),
        "mean_current_A": trial.mean_current_A,
        "noise_A": trial.noise_A,
        "true_rmse_A": trial.true_rmse_A,
        "files_sha256": files,
    }


def true_parameters(trial: Trial, effect: Concealed) -> dict[str, float]:
    """Return the true values that an interval can be held against: those that do not hang on the form of a law.

    `relative_size` is the effect's root mean square on its wheels over the mean reading; the others are the effect's
    own, where its law has the contract's constant (an onset, a constant current, an offset, an order).
    """
    moving = trial.drive.moving
    on = moving & np.isin(np.arange(1, 7), effect.wheels)
    added = effect.added_current_A(effect.size)
    size = float(np.sqrt(np.mean(added[on] ** 2)) / np.mean(np.abs(trial.current_A[moving])))
    onset = {} if effect.onset_s is None else {"onset_s": effect.onset_s}
    return {"relative_size": size, **onset, **effect.parameters(effect.size)}


def solve(batch: Batch, command: str, kind: str, number: int) -> None:
    """Let a program answer one trial and keep what it says; no answer is an answer too, with its reason."""
    folder, answer = batch.path("trials", number, ""), batch.path(kind, number)
    said = folder / f"{kind}.json"
    filled = command.format(recording="recording.csv.gz", simulation="SIM.toml", answer=said.name)
    threads = 2 if batch.jobs == 1 else 1
    started = time.perf_counter()
    try:
        run_alone(shlex.split(filled), folder, threads=threads, timeout_s=batch.timeout_s)
        content = json.loads(said.read_text())
    except (SolverError, OSError, json.JSONDecodeError) as error:
        content = {"failed": str(error)}
    answer.parent.mkdir(parents=True, exist_ok=True)
    answer.write_text(json.dumps({"seconds": time.perf_counter() - started, "answer": content}, indent=1) + "\n")
    said.unlink(missing_ok=True)


def commit(batch: Batch, number: int, digest: str) -> None:
    """Append the commitment to the batch's list, before the solver is started."""
    with batch._writing, (batch.folder / "commitments.csv").open("a") as lines:  # noqa: SLF001  # its own lock
        lines.write(f"{number},{digest},{datetime.now(UTC).isoformat(timespec='seconds')}\n")


def run_trial(batch: Batch, plan: Plan) -> Outcome:
    """Make, commit, solve, open: in this order."""
    if batch.path("opened", plan.number).exists():
        return reopened(batch, plan)
    trial = make_trial(plan, duration_s=batch.duration_s)
    paths = write_trial(trial, batch.path("trials", plan.number, ""))
    envelope = Envelope(truth_of(trial, {path.name: file_digest(path) for path in paths}))
    committed = envelope.digest
    commit(batch, plan.number, committed)
    del trial
    solve(batch, batch.solver, "answers", plan.number)
    if batch.peers:
        solve(batch, batch.peers, "peers", plan.number)
    if plan.group == "constant":
        drive_the_experiment(batch, plan)
    envelope.open_into(batch.path("opened", plan.number), committed)
    if not batch.keep:
        shutil.rmtree(batch.path("trials", plan.number, ""))
    return outcome(batch, plan.number)


def drive_the_experiment(batch: Batch, plan: Plan) -> None:
    """Simulate the experiment that the answer proposes, and let the solver answer again, the envelope still closed."""
    said = json.loads(batch.path("answers", plan.number).read_text())["answer"]
    proposed = "; ".join(one.get("experiment", "") for one in said.get("indistinguishable", []))
    if not proposed:
        return
    trial = make_trial(plan, duration_s=batch.duration_s, experiment=proposed)
    write_trial(trial, batch.path("trials", plan.number, ""))
    solve(batch, batch.solver, "experiments", plan.number)


def reopened(batch: Batch, plan: Plan) -> Outcome:
    """Return a trial that was done before, if it was of this batch."""
    done = outcome(batch, plan.number)
    if (done.truth["group"], [e["kind"] for e in done.truth["effects"]]) != (plan.group, list(plan.names)):
        raise OtherBatchError(f"{batch.folder} holds the answers to another seed's recordings")
    return done


def outcome(batch: Batch, number: int) -> Outcome:
    """Return a finished trial from its files, its seal checked."""
    peers, driven = batch.path("peers", number), batch.path("experiments", number)
    return Outcome(
        number=number,
        truth=read_opened(batch.path("opened", number)),
        answer=json.loads(batch.path("answers", number).read_text()),
        peers=json.loads(peers.read_text())["answer"] if peers.exists() else {},
        experiment=json.loads(driven.read_text())["answer"] if driven.exists() else None,
    )


def run_batch(batch: Batch) -> Iterator[Outcome]:
    """Yield each trial as it is finished; up to `jobs` solvers at a time."""
    batch.folder.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(batch.jobs) as workers:
        waiting = [workers.submit(run_trial, batch, plan) for plan in batch.plans()]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise
