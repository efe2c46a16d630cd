"""Noisy inputs are replaced by what they really were on average, and nothing else happens to them."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch import SensorError
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.inputs.autoregressive_truths import normal_truths
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import expected_inputs

START = np.array([0])


def test_a_slow_signal_is_cleaned_and_its_slope_is_not_attenuated() -> None:
    """Regressing the truth on the estimate gives 1: what regression calibration must do."""
    rng = np.random.default_rng(1)
    truth = np.sin(np.arange(6000) / 200)[:, None]
    noisy = truth + rng.normal(0, 0.3, truth.shape)
    estimate = normal_truths(noisy, np.array([0.09]), START).mean
    assert np.std(estimate - truth) < 0.35 * 0.3
    slope = float(np.sum(truth * estimate) / np.sum(estimate**2))
    assert abs(slope - 1) < 0.01
    assert float(np.sum(truth * noisy) / np.sum(noisy**2)) < 0.9


def test_without_a_stated_error_nothing_is_touched() -> None:
    """A reading that is exact is the truth."""
    values = np.random.default_rng(2).normal(0, 1, (500, 2)).cumsum(axis=0)
    np.testing.assert_allclose(normal_truths(values, np.zeros(2), START).mean, values, atol=1e-6)


def test_what_is_unknown_stays_unknown_and_does_not_spread() -> None:
    """NaN stays where it was."""
    values = np.random.default_rng(3).normal(0, 1, (500, 1)).cumsum(axis=0)
    values[100:200] = np.nan
    estimate = normal_truths(values, np.array([0.01]), START).mean
    np.testing.assert_array_equal(np.isnan(estimate), np.isnan(values))


def test_a_sensor_that_rests_at_zero_stays_there() -> None:
    """Readings of exactly 0 beside each other have no noise; a single one may be chance, and is smoothed."""
    random = np.random.default_rng(4)
    speed = np.where(np.arange(1200) % 400 < 300, 5 + random.normal(0, 0.2, 1200), 0.0)
    speed[50] = 0.0
    recording = from_columns({"t_s": np.arange(1200) / 10, "speed": speed})
    found = expected_inputs(recording, {"speed": SensorError(absolute=0.2)}).channels["speed"][:, 0]
    resting = np.arange(1200) % 400 >= 300
    assert not found[resting].any()
    assert found[~resting].all()


def test_a_run_that_begins_or_ends_with_one_reading_at_rest_does_so() -> None:
    """Exactly 0 in the first and the last reading of each run; in the middle of a run it may be chance."""
    random = np.random.default_rng(6)
    speed, at_rest = 5 + random.normal(0, 0.2, 1200), np.array([0, 599, 600, 1199])
    speed[[*at_rest, 300]] = 0.0
    columns = {"t_s": np.arange(1200) / 10, "speed": speed, "run": np.repeat([1, 2], 600)}
    found = expected_inputs(from_columns(columns), {"speed": SensorError(absolute=0.2)}).channels["speed"][:, 0]
    np.testing.assert_array_equal(np.flatnonzero(found == 0), at_rest)


def test_a_force_that_is_mostly_none_is_none_there() -> None:
    """A press pushes with up to 400 errors of its load cell, and reads its error alone while it rests."""
    random = np.random.default_rng(5)
    truth = np.zeros(6000)
    for begin in range(200, 6000, 400):
        truth[begin : begin + 100] = random.uniform(20, 120) * np.sin(np.pi * np.arange(100) / 100)
    columns = {"t_s": 0.1 * np.arange(6000.0), "force_kN": truth + random.normal(0, 0.3, 6000)}
    expected = expected_inputs(from_columns(columns), {"force_kN": SensorError(0.0, 0.3)}).channels["force_kN"][:, 0]
    at_rest = truth == 0
    assert np.sqrt(np.mean((expected - truth)[at_rest] ** 2)) < 0.1
    assert np.sqrt(np.mean((expected - truth)[~at_rest] ** 2)) < 0.35
