"""Momentary drops are removed, steps are kept, and missing values stay missing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.daemon.config.configuration import Smoothing
from regolithd.daemon.pipeline.smooth import Smoother

DEFAULTS = Smoothing()
ALL = np.ones(6, bool)


def smooth(torque: np.ndarray, rate_Hz: float, **changed: float) -> np.ndarray:
    """Return the torque of six wheels, shape (time, 6), filtered as configured by default."""
    chosen = DEFAULTS.model_dump() | changed
    smoother = Smoother(rate_Hz, **chosen)
    return np.stack(
        [smoother.step(int(k * 1e9 / rate_Hz), row, row, row).torque for k, row in enumerate(np.asarray(torque))]
    )


def noisy(rate_Hz: float, seconds: float, std: float = 0.1, seed: int = 1) -> np.ndarray:
    """Return a torque of 1 with noise."""
    return 1 + std * np.random.default_rng(seed).standard_normal((int(seconds * rate_Hz), 6))


@pytest.mark.parametrize("rate_Hz", [2.0, 10.0, 100.0])
@pytest.mark.parametrize("lasting_s", [0.5, 1.0])
def test_a_momentary_drop_leaves_less_than_a_tenth_of_what_the_low_pass_alone_would(
    rate_Hz: float, lasting_s: float
) -> None:
    """The current drops to a fifth for a moment."""
    steady = noisy(rate_Hz, 40)
    begin = int(20 * rate_Hz)
    dropped = steady.copy()
    dropped[begin : begin + int(lasting_s * rate_Hz)] *= 0.2
    after = slice(begin, begin + int(6 * rate_Hz))

    def dip(**changed: float) -> float:
        return float(np.max((smooth(steady, rate_Hz, **changed) - smooth(dropped, rate_Hz, **changed))[after].mean(1)))

    assert dip() < 0.1 * dip(threshold=0.0)


@pytest.mark.parametrize("rate_Hz", [2.0, 10.0, 100.0])
@pytest.mark.parametrize("depth", [0.25, 0.6, 1.5])
def test_a_step_that_stays_is_never_hidden(rate_Hz: float, depth: float) -> None:
    """Half of it shows within 3 s, nine tenths within 5.5 s, and all of it in the end, also below zero."""
    before = noisy(rate_Hz, 60)
    torque = before.copy()
    begin = int(30 * rate_Hz)
    torque[begin:] -= depth
    share = (smooth(before, rate_Hz) - smooth(torque, rate_Hz)).mean(axis=1) / depth
    assert share[begin + int(3 * rate_Hz)] > 0.5
    assert share[begin + int(5.5 * rate_Hz)] > 0.9
    assert share[-int(10 * rate_Hz) :] == pytest.approx(1, abs=0.01)


def test_rejecting_one_side_alone_biases_what_has_no_drops_by_little() -> None:
    """Gaussian noise of 30 % raises the mean by less than 2 %."""
    torque = noisy(2.0, 5000, std=0.3)
    assert 0 < smooth(torque, 2.0)[20:].mean() - 1 < 0.02


def test_what_did_not_arrive_stays_missing_and_disturbs_nothing() -> None:
    """A missing value is NaN in the result, and the values after it are not affected."""
    torque = noisy(2.0, 30, std=0.0)
    torque[20:23, 2] = np.nan
    smoothed = smooth(torque, 2.0)
    assert np.isnan(smoothed[20:23, 2]).all()
    assert np.isfinite(np.delete(smoothed[20:23], 2, axis=1)).all()
    np.testing.assert_allclose(smoothed[23:], 1)


def test_a_reset_wheel_begins_anew_and_the_others_go_on() -> None:
    """A reset wheel's first value passes unfiltered, and the other wheels are not affected."""
    smoother = Smoother(2.0, **DEFAULTS.model_dump())
    for k in range(20):
        smoother.step(k * 500_000_000, np.full(6, 1.0), np.full(6, 50.0), np.full(6, 0.02))
    smoother.reset(np.array([True, False, False, False, False, False]))
    torque = smoother.step(10_000_000_000, np.full(6, 0.5), np.full(6, 50.0), np.full(6, 0.02)).torque
    assert torque[0] == 0.5
    assert (torque[1:] > 0.9).all()


def test_a_clock_that_is_set_back_does_no_harm() -> None:
    """After a clock set back by an hour, one value has no effect and the following ones are filtered as before."""
    smoother = Smoother(2.0, **DEFAULTS.model_dump())
    six = np.full(6, 1.0)
    for k in range(10):
        smoother.step(10**18 + k * 500_000_000, six, six, six)
    back = 10**18 - 3600 * 10**9
    assert smoother.step(back, 2 * six, six, six).torque.tolist() == [1.0] * 6
    assert smoother.step(back + 1_500_000_000, 2 * six, six, six).torque == pytest.approx(six * (2 - np.exp(-1)))


def test_both_parts_can_be_turned_off() -> None:
    """With threshold and time constant 0 every value passes unchanged."""
    torque = noisy(10.0, 3)
    np.testing.assert_array_equal(smooth(torque, 10.0, window_s=0.0, time_constant_s=0.0), torque)
    np.testing.assert_array_equal(smooth(torque, 10.0, threshold=0.0, time_constant_s=0.0), torque)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.lists(st.floats(-100, 100) | st.just(np.nan), min_size=6, max_size=6), min_size=1, max_size=60))
def test_the_result_stays_within_what_came_in_and_is_missing_exactly_where_nothing_did(rows: list[list[float]]) -> None:
    """For any input the result is between its extremes, and NaN exactly where the input is."""
    torque = np.array(rows)
    smoothed = smooth(torque, 2.0)
    np.testing.assert_array_equal(np.isnan(smoothed), np.isnan(torque))
    for wheel in range(6):
        seen = torque[:, wheel][~np.isnan(torque[:, wheel])]
        if seen.size:
            found = smoothed[:, wheel][~np.isnan(smoothed[:, wheel])]
            assert found.min() >= seen.min() - 1e-9
            assert found.max() <= seen.max() + 1e-9
