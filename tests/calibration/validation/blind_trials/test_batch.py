"""A batch: order of commitment and solver, isolation, resumption, and the score."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.validation.blind_trials.batch import Batch, Outcome, run_batch
from regolithd.calibration.validation.blind_trials.commitment import commitment_digest, read_opened
from regolithd.calibration.validation.blind_trials.errors import OtherBatchError
from regolithd.calibration.validation.blind_trials.isolation import namespaces_available
from regolithd.calibration.validation.blind_trials.score import figures_of, judge

if TYPE_CHECKING:
    from pathlib import Path

SPY = """
import json, os, pathlib, sys
others = [p for p in os.listdir('/proc') if p.isdigit() and int(p) != os.getpid()]
committed = pathlib.Path('../../commitments.csv').read_text().count(chr(10))
opened = pathlib.Path('../../opened')
json.dump({'verdict': 'consistent', 'effects': [], 'files': sorted(os.listdir('.')), 'environment': sorted(os.environ),
           'arguments': sys.argv, 'processes': others, 'committed': committed,
           'opened': len(list(opened.iterdir())) if opened.exists() else 0}, open(sys.argv[1], 'w'))
"""


ASKS = """
import gzip, json, sys
speeds = {line.split(',')[3] for line in gzip.open('recording.csv.gz', 'rt')}
told = {'effects': ['coulomb-friction', 'viscous-friction'], 'experiment': 'hold four speeds, both ways'}
told |= {'vary': ['wheel_speed', 'direction'], 'duration_s': 600.0, 'lift': False}
said = {'verdict': 'consistent', 'effects': [], 'indistinguishable': [told] if len(speeds) < 5 else []}
json.dump(said | {'speeds': len(speeds)}, open(sys.argv[1], 'w'))
"""


@pytest.fixture
def batch(tmp_path: Path) -> Batch:
    """Ten recordings of two minutes; the solver writes what it can see of its surroundings, and `consistent`."""
    spy = tmp_path / "spy.py"
    spy.write_text(SPY)
    return Batch(
        folder=tmp_path / "batch",
        seed=4,
        recordings=10,
        solver=f"{sys.executable} {spy} {{answer}}",
        baselines=None,
        duration_s=120,
    )


def test_the_solver_is_given_two_files_and_the_commitment_is_older(batch: Batch) -> None:
    """When the n-th solver starts there are n commitments, n − 1 opened ones, and nothing beside its two files."""
    outcomes = sorted(run_batch(batch), key=lambda outcome: outcome.number)
    for before, outcome in enumerate(outcomes):
        seen = outcome.answer["answer"]
        assert seen["files"] == ["SIM.toml", "recording.csv.gz"]
        assert seen["committed"] == before + 1
        assert seen["opened"] == before
        if namespaces_available():
            assert seen["processes"] == []
    with (batch.folder / "commitments.csv").open() as lines:
        committed = {int(number): digest for number, digest, _ in csv.reader(lines)}
    for number, digest in committed.items():
        opened = json.loads(batch.path("opened", number).read_text())
        assert commitment_digest(opened["salt"], opened["truth"]) == digest
        assert "seed" not in json.dumps(opened)


def test_a_finished_trial_is_not_repeated(batch: Batch) -> None:
    """An interrupted batch resumes without repeating trials; the folder of another seed is refused."""
    first = replace(batch, groups=("nothing", "pair"))
    few = len(list(run_batch(first)))
    lines = (batch.folder / "commitments.csv").read_text().splitlines()
    assert 0 < few == len(lines) < 10
    assert len(list(run_batch(batch))) == 10
    assert (batch.folder / "commitments.csv").read_text().splitlines()[:few] == lines
    assert len((batch.folder / "commitments.csv").read_text().splitlines()) == 10
    with pytest.raises(OtherBatchError):
        list(run_batch(replace(batch, seed=5)))


def test_a_solver_that_fails_is_not_right(batch: Batch) -> None:
    """A solver that fails on a recording without effects is not scored as right."""
    broken = replace(batch, solver="false", groups=("nothing",))
    verdicts = [judge(outcome) for outcome in run_batch(broken)]
    assert verdicts
    assert not any(verdict.right for verdict in verdicts)


def answered(group: str, hidden: list[dict[str, object]], **said: object) -> Outcome:
    """Return an outcome with this truth and this answer."""
    truth = {"group": group, "effects": hidden, "duration_s": 1000.0, "true_rmse_A": 0.01}
    answer = {"verdict": "consistent", "effects": [], "unexplained": [], "indistinguishable": [], "fit": {}, **said}
    return Outcome(0, truth, {"seconds": 1.0, "answer": answer}, {})


BEARING = {
    "name": "bearing-drag",
    "kind": "bearing-drag",
    "wheels": [4],
    "covariate": "time",
    "onset_s": 600.0,
    "parameters": {"drag": 0.004},
}
FOUND = {
    "name": "bearing-drag",
    "wheels": [4],
    "onset_s": 690.0,
    "parameters": {"drag": {"value": 0.005, "low": 0.0045, "high": 0.0055}},
}


def test_right_is_the_exact_set_the_wheels_and_the_onset() -> None:
    """A wrong name, wheel, interval or onset is counted in its own figure."""
    right = judge(answered("single", [BEARING], verdict="missing-physics", effects=[FOUND]))
    assert (right.right, right.wheels, right.onset, right.intervals) == (True, True, True, (False,))
    late = judge(answered("single", [BEARING], effects=[{**FOUND, "onset_s": 701.0, "wheels": [3, 4]}]))
    assert (late.right, late.wheels, late.onset) == (True, False, False)
    both = judge(answered("single", [BEARING], effects=[FOUND, {**FOUND, "name": "coulomb-friction"}]))
    assert not both.right


def test_right_is_consistent_on_nothing_and_located_out_of_library() -> None:
    """Nothing must be `consistent`; an effect out of the library `unexplained`, without a name, and located."""
    assert judge(answered("nothing", [])).right
    assert not judge(answered("nothing", [], verdict="unexplained")).right
    unknown = {"name": None, "kind": "voltage", "wheels": [1, 2, 3, 4, 5, 6], "covariate": "voltage"}
    place = [{"covariate": "voltage", "wheels": [1]}]
    assert judge(answered("outside", [unknown], verdict="unexplained", unexplained=place)).right
    elsewhere = [{"covariate": "roll", "wheels": [1]}]
    assert not judge(answered("outside", [unknown], verdict="unexplained", unexplained=elsewhere)).right
    named = judge(answered("outside", [unknown], verdict="unexplained", unexplained=place, effects=[FOUND]))
    assert not named.right


def test_the_proposed_experiment_is_run_with_the_same_truth(batch: Batch, tmp_path: Path) -> None:
    """At constant speed the proposed experiment is recorded, and answered before the commitment is opened."""
    asks = tmp_path / "asks.py"
    asks.write_text(ASKS)
    asking = replace(batch, recordings=12, solver=f"{sys.executable} {asks} {{answer}}", groups=("constant",))
    (outcome,) = run_batch(asking)
    assert outcome.answer["answer"]["speeds"] == 2
    assert outcome.experiment is not None
    assert outcome.experiment["speeds"] > 5
    verdict = judge(outcome)
    assert verdict.undecided
    assert not verdict.decided


def test_figures_are_flat(batch: Batch) -> None:
    """The figures are one flat dictionary of numbers."""
    figures = figures_of(list(run_batch(replace(batch, groups=("nothing", "single")))))
    assert figures["exact_set_nothing"] == 1.0
    assert figures["exact_set_single"] == 0.0
    assert all(isinstance(value, float | int) for value in figures.values())


def test_the_scored_truth_is_the_committed_one(batch: Batch) -> None:
    """The truth that is scored is the opened one, whose digest was verified."""
    for outcome in run_batch(replace(batch, groups=("single",))):
        assert read_opened(batch.path("opened", outcome.number)) == outcome.truth
