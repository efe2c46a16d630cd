"""Blocks of time and folds."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import INSTANTS, STEP_S, problem_of, table

from regolithd.calibration.mismatch.regression.blocks import blocks_of_time, folds_of_blocks
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
from regolithd.calibration.mismatch.thresholds import Thresholds

LENGTH_S = (INSTANTS - 1) * STEP_S


def block_lengths(autocorrelation_time: float, **limits: float) -> np.ndarray:
    """Return the lengths [s] of the blocks, but for the last."""
    problem = problem_of(table(), Thresholds(**limits))  # type: ignore[arg-type]
    blocks = blocks_of_time(problem, NoiseModel(np.ones(2), autocorrelation_time))
    return np.bincount(blocks)[:-1] * STEP_S


@pytest.mark.parametrize("time", [1.0, 2.0, 3.0])
def test_a_block_is_ten_autocorrelation_times_long(time: float) -> None:
    """Where that is neither too many blocks nor too few."""
    found = block_lengths(time, most_blocks=INSTANTS, blocks_per_fold=1)
    np.testing.assert_allclose(found, 10 * time * STEP_S, atol=STEP_S)


def test_there_are_no_more_blocks_than_a_variance_needs() -> None:
    """Under white noise blocks are as long as the most of them allow."""
    np.testing.assert_allclose(block_lengths(1.0, most_blocks=40), LENGTH_S / 40, atol=STEP_S)


def test_a_short_recording_has_enough_blocks_for_its_folds() -> None:
    """Six for each of five folds."""
    np.testing.assert_allclose(block_lengths(100.0), LENGTH_S / 30, atol=STEP_S)


def test_no_block_holds_two_runs() -> None:
    """A run that ends in the middle of a block ends the block."""
    columns = table(runs=3)
    problem = problem_of(columns)
    blocks = blocks_of_time(problem, NoiseModel(np.ones(2), 1.0))
    for block in np.unique(blocks):
        assert len(np.unique(problem.recording.run[blocks == block])) == 1


def test_folds_are_blocks_in_turn() -> None:
    """Every fifth block, so that each fold sees all of the recording."""
    problem = problem_of(table())
    blocks = blocks_of_time(problem, NoiseModel(np.ones(2), 1.0))
    folds = folds_of_blocks(problem, blocks)
    np.testing.assert_array_equal(folds, blocks % 5)
    assert set(np.unique(folds)) == set(range(5))


def test_with_enough_runs_whole_runs_are_held_out() -> None:
    """No run is in two folds."""
    problem = problem_of(table(runs=7))
    folds = folds_of_blocks(problem, np.zeros(INSTANTS, np.int64))
    for run in range(7):
        assert set(folds[problem.recording.run == run]) == {run % 5}
