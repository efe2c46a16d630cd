"""A batch: for each case make the files, commit to the truth, let the solver answer, open the truth.

In the batch's folder:

    commitments.csv     number, digest: appended before the solver is started, never changed
    trials/NNNN/0/      what the solver is given: recording.csv.gz, SIM.toml and what that names; `1` in other units
    answers/NNNN.json   what it said of each, and in how many seconds
    opened/NNNN.json    salt and truth, written after the answers

A corrected file is compared with a later recording in a second step: only then does that recording reach the solver's
folder. A case that the solver refuses is an answer too: its message.
"""

from __future__ import annotations

import json
import shlex
import shutil
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.validation.blind_trials.commitment import Commitment, Truth, file_digest, read_opened
from regolithd.calibration.validation.blind_trials.errors import OtherBatchError, SolverError
from regolithd.calibration.validation.blind_trials.isolation import run_isolated
from regolithd.calibration.validation.machine_trials.cases.files import write_recording, write_simulation
from regolithd.calibration.validation.machine_trials.cases.generator import GROWN, Case, Recorded, make_case
from regolithd.calibration.validation.machine_trials.cases.strength import readings

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.calibration.validation.machine_trials.cases.plan import Plan
    from regolithd.calibration.validation.machine_trials.physics.machine import Effect

SOLVER = (
    f"{shlex.quote(sys.executable)} -m regolithd mismatch {{recording}} --simulation {{simulation}} --json {{answer}}"
)
CORRECTED = "CORRECTED.toml"


@dataclass(frozen=True)
class Batch:
    """What to do and where; `solver` is a command with {recording}, {simulation} and {answer}."""

    folder: Path
    plans: tuple[Plan, ...]
    solver: str = SOLVER
    keep: bool = False
    timeout_s: float = 600.0

    def path(self, kind: str, number: int, suffix: str = ".json") -> Path:
        """Return where a case's file of this kind is."""
        return self.folder / kind / f"{number:04d}{suffix}"


@dataclass(frozen=True)
class Outcome:
    """One case after its truth was opened: what it was, and what the solver said of it, once for each unit system.

    `first` is the answer that a corrected simulation was made from.
    """

    truth: Truth
    answers: list[dict[str, Any]]
    first: dict[str, Any] | None
    seconds: float


def described(recorded: Recorded, effect: Effect) -> dict[str, Any]:
    """Return an effect as the truth has it. `relative_size` is over the mean absolute reading, noise and all."""
    world = recorded.world
    acting = world.drive.compared[:, list(effect.axes)]
    added = (readings(world, [effect])[effect.channel] - world.base[effect.channel])[:, list(effect.axes)]
    reading = np.abs(recorded.measured[effect.channel][world.drive.compared])
    return {
        "name": effect.name,
        "kind": effect.kind,
        "channel": effect.channel,
        "axes": [world.machine.axes[axis] for axis in effect.axes],
        "covariate": effect.covariate,
        "onset_s": effect.onset_s,
        "strength": effect.strength,
        "parameters": {
            "relative_size": float(np.sqrt(np.mean(added[acting] ** 2)) / reading.mean()),
            **({} if effect.onset_s is None else {"onset_s": effect.onset_s}),
            **effect.parameters(effect.size),
        },
    }


def truth_of(case: Case, files: dict[str, str]) -> Truth:
    """Return what is sealed: what the last answer should say, and what it rests on. No seed."""
    plan, last = case.plan, case.later or case.first
    kept = {effect.kind for effect in case.first.effects} if case.later else set()
    known = case.machine.parameters
    return {
        "machine": plan.machine,
        "kind": plan.kind,
        "index": plan.index,
        "concealed": list(plan.names),
        "axes": list(case.machine.axes) if case.machine.axis_column else [],
        "effects": [described(last, effect) for effect in last.effects if effect.kind not in kept],
        "corrected": [described(case.first, effect) for effect in case.first.effects] if case.later else [],
        "change": {"corrected-grown": GROWN, "corrected-gone": 0.0}.get(plan.kind),
        "parameters": {
            name: {"true": last.world.values[name], "prior": one.value, "prior_std": one.std}
            for name, one in known.items()
        },
        "duration_s": float(np.ptp(last.world.drive.t_s)),
        "rate_Hz": 1 / last.world.drive.step_s,
        "true_rmse": {channel: last.true_rmse(channel) for channel in last.measured},
        "units": [
            {
                "channels": {channel: units.renamed(channel) for channel in last.measured},
                "scales": {old: scale for old, _, scale, _ in units.changes},
            }
            for units in case.units
        ],
        "margin": None if np.isinf(last.margin) else last.margin,
        "files_sha256": files,
    }


def write_case(case: Case, folder: Path) -> dict[str, str]:
    """Write all files of a case and return their digests."""
    written: list[Path] = []
    for at, units in enumerate(case.units):
        written += write_simulation(case.machine, units, folder / str(at))
        written.append(write_recording(case.first, units, folder / str(at) / "recording.csv.gz"))
    if case.later:
        (folder / "kept").mkdir(exist_ok=True)
        written.append(write_recording(case.later, case.units[0], folder / "kept" / "later.csv.gz"))
    return {str(path.relative_to(folder)): file_digest(path) for path in written}


def ask(batch: Batch, folder: Path, recording: str, simulation: str, extra: str = "") -> dict[str, Any]:
    """Let the solver answer once; no answer is an answer too, with its reason."""
    said = folder / "answer.json"
    said.unlink(missing_ok=True)
    command = batch.solver.format(recording=recording, simulation=simulation, answer=said.name) + extra
    try:
        run_isolated(shlex.split(command), folder, threads=1, timeout_s=batch.timeout_s)
        return json.loads(said.read_text())
    except (SolverError, OSError, json.JSONDecodeError) as error:
        return {"failed": str(error)}


def ask_again(batch: Batch, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Let the solver correct the simulation, and compare the corrected one with the later recording."""
    first = ask(batch, folder / "0", "recording.csv.gz", "SIM.toml", f" --corrected {CORRECTED}")
    if "failed" in first:
        return first, first
    if not (folder / "0" / CORRECTED).exists():
        return first, {"failed": "no corrected simulation was written"}
    shutil.move(folder / "kept" / "later.csv.gz", folder / "0" / "later.csv.gz")
    return first, ask(batch, folder / "0", "later.csv.gz", CORRECTED)


def run_case(batch: Batch, plan: Plan) -> Outcome:
    """Make, commit, solve, open: in this order."""
    opened, folder = batch.path("opened", plan.number), batch.path("trials", plan.number, "")
    if opened.exists():
        return reopened(batch, plan)
    case = make_case(plan)
    sealed = Commitment(truth_of(case, write_case(case, folder)))
    committed = sealed.digest
    with (batch.folder / "commitments.csv").open("a") as lines:
        lines.write(f"{plan.number},{committed}\n")
    units, later = len(case.units), case.later is not None
    del case
    started, first = time.perf_counter(), None
    if later:
        first, last = ask_again(batch, folder)
        answers = [last]
    else:
        answers = [ask(batch, folder / str(at), "recording.csv.gz", "SIM.toml") for at in range(units)]
    told = {"seconds": time.perf_counter() - started, "first": first, "answers": answers}
    path = batch.path("answers", plan.number)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(told, indent=1) + "\n")
    sealed.open_into(opened, committed)
    if not batch.keep:
        shutil.rmtree(folder)
    return outcome(batch, plan.number)


def reopened(batch: Batch, plan: Plan) -> Outcome:
    """Return a case that was done before, if it was of this batch."""
    done = outcome(batch, plan.number)
    was = (done.truth["machine"], done.truth["kind"], done.truth["index"], done.truth["concealed"])
    if was != (plan.machine, plan.kind, plan.index, list(plan.names)):
        raise OtherBatchError(f"{batch.folder} holds the answers to another seed's cases")
    return done


def outcome(batch: Batch, number: int) -> Outcome:
    """Return a finished case from its files, its seal checked."""
    told = json.loads(batch.path("answers", number).read_text())
    return Outcome(read_opened(batch.path("opened", number)), told["answers"], told["first"], told["seconds"])


def run_batch(batch: Batch) -> Iterator[Outcome]:
    """Yield each case as it is finished."""
    batch.folder.mkdir(parents=True, exist_ok=True)
    for plan in batch.plans:
        yield run_case(batch, plan)
