"""The noise model: standard deviations and the autocorrelation time of noise whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel, estimate_noise
from regolithd.calibration.mismatch.thresholds import Thresholds


def autoregressive(persistence: float, deviations: tuple[float, ...], instants: int = 20_000) -> np.ndarray:
    """Return first-order autoregressive noise, shape (time, wheel)."""
    rng = np.random.default_rng(1)
    values = rng.normal(size=(instants, len(deviations)))
    for k in range(1, instants):
        values[k] = persistence * values[k - 1] + np.sqrt(1 - persistence**2) * values[k]
    return values * np.array(deviations)


@pytest.mark.parametrize("persistence", [0.0, 0.5, 0.9])
def test_an_autoregressive_noise_has_its_autocorrelation_time(persistence: float) -> None:
    """The sum over all lags of persistence^|lag| is (1 + persistence) / (1 − persistence)."""
    residual = autoregressive(persistence, (0.5, 2.0))
    noise = estimate_noise(residual, np.ones(residual.shape, bool))
    np.testing.assert_allclose(noise.deviation, [0.5, 2.0], rtol=0.05)
    assert noise.autocorrelation_time == pytest.approx((1 + persistence) / (1 - persistence), rel=0.1)


def test_what_is_masked_has_no_part_in_the_estimate() -> None:
    """Absurd values outside the mask change nothing."""
    residual = autoregressive(0.5, (1.0, 1.0), 6000)
    mask = np.random.default_rng(2).uniform(size=residual.shape) > 0.3
    spoilt = np.where(mask, residual, 1e6)
    one, other = estimate_noise(residual, mask), estimate_noise(spoilt, mask)
    np.testing.assert_array_equal(one.deviation, other.deviation)
    assert one.autocorrelation_time == other.autocorrelation_time
    # Of (1 + 0.5)/(1 − 0.5) = 3, the part of the other lags counts by the share of readings: 1 + 0.7 · 2.
    assert one.autocorrelation_time == pytest.approx(2.4, rel=0.1)


def test_a_sensor_read_in_every_tenth_row_has_the_noise_of_its_own_readings() -> None:
    """Its autocorrelation time is that of the readings alone, as if no other rows had been written."""
    residual = autoregressive(0.95, (1.0, 1.0), 40_000)
    every_tenth = (np.arange(len(residual)) % 10 == 0)[:, None] & np.ones_like(residual, bool)
    own = residual[::10]
    alone = estimate_noise(own, np.ones(own.shape, bool)).autocorrelation_time
    assert estimate_noise(residual, every_tenth).autocorrelation_time == pytest.approx(alone, rel=0.02)
    assert alone == pytest.approx((1 + 0.95**10) / (1 - 0.95**10), rel=0.2)


def test_a_wheel_without_residual_takes_the_deviation_of_the_others() -> None:
    """A silent wheel would else have an infinite weight."""
    residual = autoregressive(0.0, (1.0, 3.0, 0.0), 2000)
    noise = estimate_noise(residual, np.ones(residual.shape, bool))
    assert noise.deviation[2] == pytest.approx(np.median(noise.deviation[:2]))
    nothing = estimate_noise(np.zeros((300, 2)), np.ones((300, 2), bool))
    np.testing.assert_array_equal(nothing.deviation, [1.0, 1.0])


def test_noise_that_alternates_counts_as_white() -> None:
    """An autocorrelation time is at least one reading."""
    residual = np.tile([[1.0], [-1.0]], (500, 1))
    assert estimate_noise(residual, np.ones(residual.shape, bool)).autocorrelation_time == 1.0


def test_lags_end_at_the_threshold() -> None:
    """With a stricter limit of significance fewer lags are summed."""
    residual = autoregressive(0.9, (1.0,), 3000)
    mask = np.ones(residual.shape, bool)
    strict = estimate_noise(residual, mask, Thresholds(lag_significance=20.0))
    assert strict.autocorrelation_time < 0.8 * estimate_noise(residual, mask).autocorrelation_time
    short = estimate_noise(residual, mask, Thresholds(longest_lag_share=0.002))
    assert short.autocorrelation_time < 0.8 * estimate_noise(residual, mask).autocorrelation_time


def test_weights_are_one_over_the_long_run_variance() -> None:
    """A deviation of 2 and 5 readings for one make 1 / 20."""
    np.testing.assert_allclose(NoiseModel(np.array([2.0]), 5.0).weights, [0.05])


def test_wheels_have_autocorrelation_times_of_their_own_where_they_differ_beyond_chance() -> None:
    """One wheel with memory beside two without, which have the pooled one; so have four that are alike."""
    unlike = np.concatenate((autoregressive(0.9, (1.0,)), autoregressive(0.0, (1.0, 1.0))), axis=1)
    times = estimate_noise(unlike, np.ones(unlike.shape, bool)).autocorrelation_times
    np.testing.assert_allclose(times, [19.0, 7.0, 7.0], rtol=0.2)
    alike = autoregressive(0.5, (1.0, 1.0, 2.0, 0.5), 3000)
    times = estimate_noise(alike, np.ones(alike.shape, bool)).autocorrelation_times
    np.testing.assert_allclose(times, 3.0, rtol=0.15)
    assert np.ptp(times) < 0.1 * np.mean(times)


def test_a_wheel_without_readings_has_the_pooled_autocorrelation_time() -> None:
    """Nothing is known of its own."""
    residual = autoregressive(0.5, (1.0, 1.0, 1.0), 6000)
    mask = np.ones(residual.shape, bool)
    mask[:, 2] = False
    assert estimate_noise(residual, mask).autocorrelation_times[2] == pytest.approx(3.0, rel=0.15)


def test_quiet_readings_at_rest_do_not_make_those_in_motion_more_certain() -> None:
    """Half of the readings are at rest, with a tenth of the noise; a wheel that hardly moves has that of all."""
    moving = np.repeat([[True, True], [False, False]], 500, axis=0)
    moving = np.tile(moving, (6, 1))
    moving[:, 1] &= np.arange(len(moving)) < 100
    residual = autoregressive(0.0, (1.0, 1.0), len(moving)) * np.where(moving, 1.0, 0.1)
    mask = np.ones(residual.shape, bool)
    of_all, in_motion = estimate_noise(residual, mask), estimate_noise(residual, mask, moving=moving)
    assert of_all.deviation[0] == pytest.approx(0.71, rel=0.05)
    assert in_motion.deviation[0] == pytest.approx(1.0, rel=0.05)
    assert in_motion.deviation[1] == of_all.deviation[1]


def test_readings_that_are_louder_at_rest_count_as_well() -> None:
    """A controller that hunts at rest: the deviation is not less than that of all."""
    moving = np.arange(4000)[:, None] % 1000 < 500
    residual = autoregressive(0.0, (1.0,), 4000) * np.where(moving, 0.1, 1.0)
    mask = np.ones(residual.shape, bool)
    assert estimate_noise(residual, mask, moving=moving).deviation == estimate_noise(residual, mask).deviation
