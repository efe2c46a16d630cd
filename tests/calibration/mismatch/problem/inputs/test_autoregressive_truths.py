"""Errors in variables against the normal distribution's own formula, on series of a few readings."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import Recording
from regolithd.calibration.mismatch.problem.inputs.autoregressive_truths import _autoregression, normal_truths
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import expected_inputs, known_mean
from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.prior import SensorError

Array = NDArray[np.float64]
RANDOM = np.random.default_rng(7)


def by_matrices(values: Array, persistence: float, variance: float, error: float, starts: list[int]) -> Array:
    """Return E[truth | readings] from the joint normal distribution: C (C + R)⁻¹ (y − mean), run by run."""
    known = np.isfinite(values)
    mean = values[known].mean()
    run = np.searchsorted(starts, np.arange(len(values)), side="right")
    lag = np.abs(np.subtract.outer(np.arange(len(values)), np.arange(len(values))))
    covariance = variance * persistence**lag * np.equal.outer(run, run)
    seen = covariance[np.ix_(known, known)] + error * np.eye(int(known.sum()))
    found = mean + covariance[:, known] @ np.linalg.solve(seen, values[known] - mean)
    return np.where(known, found, np.nan)


@pytest.mark.parametrize("starts", [[0], [0, 11], [0, 1, 20]])
def test_the_smoother_is_the_conditional_expectation(starts: list[int]) -> None:
    """Forwards and backwards passes give what the matrices give, with gaps and across several runs."""
    truth = np.cumsum(RANDOM.normal(0, 0.5, (40, 3)), axis=0)
    values = truth + RANDOM.normal(0, 0.4, truth.shape)
    values[5, 0] = values[17:20, 1] = np.nan
    error = np.array([0.16, 0.16, 0.02])
    known = np.isfinite(values)
    centred = np.where(known, values - np.nanmean(values, axis=0), 0.0)
    persistence, variance = _autoregression(centred, known, error)
    expected = [
        by_matrices(values[:, k], float(persistence[k]), float(variance[k]), float(error[k]), starts) for k in range(3)
    ]
    np.testing.assert_allclose(normal_truths(values, error, np.array(starts)).mean, np.transpose(expected))


def test_persistence_and_variance_of_a_known_process() -> None:
    """A first-order autoregressive truth of variance 4 and correlation 0.95, read with a variance of 0.25."""
    count, persistence = 40_000, 0.95
    truth = np.zeros((count, 1))
    steps = RANDOM.normal(0, 2 * np.sqrt(1 - persistence**2), count)
    for t in range(1, count):
        truth[t] = persistence * truth[t - 1] + steps[t]
    values = truth + RANDOM.normal(0, 0.5, truth.shape)
    found, variance = _autoregression(values - values.mean(), np.ones(values.shape, bool), np.array([0.25]))
    assert found[0] == pytest.approx(persistence, abs=0.005)
    assert variance[0] == pytest.approx(4.0, rel=0.15)


def test_the_lag_is_the_shortest_at_which_the_truth_moves_as_much_as_the_error() -> None:
    """Half the mean square of increments at this lag, less the error, gives the persistence; lags double."""
    values = np.array([0.0, 1.0, 0.0, -1.0] * 16)[:, None] + np.repeat([3.0, -3.0], 32)[:, None]
    known = np.ones(values.shape, bool)
    variance = float(np.mean(values**2)) - 0.3
    found, spread = _autoregression(values, known, np.array([0.3]))
    assert spread[0] == pytest.approx(variance)
    for lag in (1, 2, 4, 8):
        half = 0.5 * float(np.mean((values[lag:] - values[:-lag]) ** 2)) - 0.3
        if half > 0.3:
            break
    assert lag == 1 or half > 0.3
    assert found[0] == pytest.approx((1 - half / variance) ** (1 / lag))


def test_a_truth_that_never_moves_has_a_persistence_of_its_own() -> None:
    """Where no lag tells truth and error apart, 0.999 is taken; the variance stays above a thousandth of the total."""
    values = np.tile([0.1, -0.1], 50)[:, None]
    found, variance = _autoregression(values, np.ones(values.shape, bool), np.array([5.0]))
    assert found[0] == pytest.approx(0.999)
    assert variance[0] == pytest.approx(1e-3 * 0.01)


def recording(**channels: Array) -> Recording:
    """Return a recording of two wheels, two runs of 20 instants."""
    time_s = np.tile(np.arange(20.0), 2)
    return Recording(time_s, np.repeat([0, 1], 20), (1, 2), channels)


def test_an_input_is_replaced_where_it_has_an_error() -> None:
    """Wheel by wheel, and where the error is relative, on the scale on which it is not."""
    load, slip = RANDOM.normal(50, 5, (40, 2)), RANDOM.normal(0.1, 0.02, (40, 2))
    found = expected_inputs(
        recording(load=load, slip=slip, other=load),
        {"load": SensorError(relative=0.05), "slip": SensorError(absolute=0.01), "other": SensorError()},
    )
    scales = [ReadingScale.of(column, SensorError(relative=0.05)) for column in load.T]
    stabilised = np.stack([scale.stabilised(column) for scale, column in zip(scales, load.T, strict=True)], axis=1)
    variances = np.array([*(scale.deviation for scale in scales), 0.01, 0.01]) ** 2
    expected = normal_truths(np.hstack((stabilised, slip)), variances, np.array([0, 20])).mean
    for column, scale in enumerate(scales):
        np.testing.assert_allclose(found.channels["load"][:, column], scale.readings(expected[:, column]))
    np.testing.assert_allclose(found.channels["slip"], expected[:, 2:])
    assert found.channels["other"] is load
    assert np.std(found.channels["load"]) < 0.95 * np.std(load)


def test_a_recording_without_errors_is_returned_as_it_is() -> None:
    """Neither a sensor without error nor one that was not recorded changes anything."""
    given = recording(load=np.ones((40, 2)))
    assert expected_inputs(given, {"load": SensorError(), "pitch": SensorError(absolute=1.0)}) is given


def test_the_mean_over_what_is_known() -> None:
    """0 where nothing is; along either axis."""
    values = np.array([[1.0, np.nan], [3.0, np.nan], [np.nan, np.nan]])
    np.testing.assert_array_equal(known_mean(values), [2.0, 0.0])
    np.testing.assert_array_equal(known_mean(values, axis=1), [1.0, 3.0, 0.0])
