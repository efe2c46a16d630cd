"""The speed comparison of the sizing study."""

from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.paper import sizing
from regolithd.calibration.paper.sizing_speed import compare_speed, figures
from regolithd.calibration.paper.training_set import training_set
from regolithd.calibration.parameters import Drivetrain, Wheel

STUDY = sizing.Study(sizes=(5, 6), trainings=3, epochs=20)


def test_both_are_timed_and_the_ratios_follow(tmp_path: Path) -> None:
    """A few epochs of each give positive times, and the figures hold the paper's size beside the best."""
    pairs = training_set(Drivetrain(), Wheel(), np.random.default_rng(1))
    speed = compare_speed(pairs, tmp_path, epochs=3, trainings=1)
    assert min(speed.ours_s, speed.ours_cpu_s, speed.scikit_learn_s, speed.scikit_learn_cpu_s) > 0
    assert speed.ratio_cpu == pytest.approx(speed.scikit_learn_cpu_s / speed.ours_cpu_s)
    found = figures(STUDY, [sizing.Outcome(5, 0, 0.1, 20), sizing.Outcome(6, 0, 0.2, 20)], speed)
    assert (found["best_size"], found["paper_size"], found["reached_goal"]) == (5, 64, 0)
