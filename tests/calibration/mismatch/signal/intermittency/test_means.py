"""Means of readings that follow each other."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.signal.intermittency.means import block_means, local_means, running_mean


def test_running_means_are_those_of_readings_that_follow_each_other() -> None:
    """Three readings have two means of two."""
    assert running_mean(np.array([1.0, 3.0, 7.0]), 2).tolist() == [2.0, 5.0]


def test_blocks_share_no_reading() -> None:
    """Of seven readings, two blocks of three; the last reading is in none."""
    assert block_means(np.arange(7.0), 3).tolist() == [1.0, 4.0]


def test_local_means_are_of_what_is_used_in_the_same_run() -> None:
    """What is not used stays as it is; at the ends of a run there are fewer readings."""
    values = np.array([[1.0], [3.0], [100.0], [5.0], [7.0], [9.0]])
    used = values < 100
    found = local_means(values, used, np.array([0, 4]), 3)
    assert found[:, 0].tolist() == [2.0, 2.0, 100.0, 5.0, 8.0, 8.0]
