"""The sizing study can be interrupted, goes on, and comes out the same."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.paper import sizing
from regolithd.calibration.paper.training_set import TrainingSet, training_set
from regolithd.calibration.parameters import Drivetrain, Wheel

STUDY = sizing.Study(sizes=(5, 6), trainings=3, epochs=20)


@pytest.fixture(scope="module")
def pairs() -> TrainingSet:
    """Return the 504 pairs."""
    return training_set(Drivetrain(), Wheel(), np.random.default_rng(1))


def test_an_interrupted_study_goes_on_and_comes_out_the_same(tmp_path: Path, pairs: TrainingSet) -> None:
    """Two trainings, a line cut short by a kill, then the rest: the same as in one go."""
    log = tmp_path / "log.jsonl"
    list(islice(sizing.run(STUDY, pairs, sizing.resume(log, STUDY), log, 1), 2))
    log.write_text(log.read_text() + '{"neurons": 6, "num')
    done = sizing.resume(log, STUDY)
    assert len(done) >= 2
    list(sizing.run(STUDY, pairs, done, log, 2))
    whole = tmp_path / "whole.jsonl"
    at_once = list(sizing.run(STUDY, pairs, sizing.resume(whole, STUDY), whole, 2))
    assert len(at_once) == 6
    assert set(sizing.resume(log, STUDY)) == set(at_once)


def test_the_log_of_another_study_is_refused(tmp_path: Path) -> None:
    """Outcomes of different settings are never mixed."""
    sizing.resume(tmp_path / "log.jsonl", STUDY)
    with pytest.raises(sizing.DifferentStudyError):
        sizing.resume(tmp_path / "log.jsonl", sizing.Study(sizes=(5, 6), trainings=4, epochs=20))


def test_sizes_are_summarised_by_their_mean() -> None:
    """The mean counts, not the luckiest training."""
    lucky = [sizing.Outcome(5, 0, 0.1, 9), sizing.Outcome(5, 1, 0.5, 9)]
    steady = [sizing.Outcome(6, 0, 0.2, 9), sizing.Outcome(6, 1, 0.2, 9)]
    best = min(sizing.summarise(lucky + steady), key=lambda each: each.mean_mse)
    assert (best.neurons, best.mean_mse) == (6, pytest.approx(0.2))
