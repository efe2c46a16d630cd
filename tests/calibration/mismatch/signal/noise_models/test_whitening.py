"""Whitening: an autoregression of the noise, applied to readings and taken back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import lfilter

from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED, Whitening, estimate_whitening
from regolithd.calibration.mismatch.thresholds import Thresholds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WHOLE = (slice(0, 20_000),)
NO_WHITE = Thresholds(least_white=0.0)
"""Adds no white noise to the estimate."""


def slow_noise(keeps: float, white: float, readings: int = 20_000) -> Array:
    """Return noise of unit variance with a memory, a share of it without."""
    rng = np.random.default_rng(3)
    slow = lfilter([np.sqrt(1 - keeps**2)], [1, -keeps], rng.standard_normal(readings))
    return np.asarray(np.sqrt(1 - white) * slow + np.sqrt(white) * rng.standard_normal(readings))


def powers(values: Array) -> tuple[float, float]:
    """Return the mean power at low and at high frequencies, over that of all."""
    power = np.abs(np.fft.rfft(values)) ** 2
    return float(power[10:200].mean() / power.mean()), float(power[4000:].mean() / power.mean())


@pytest.mark.parametrize(("keeps", "white"), [(0.9, 0.0), (0.98, 0.5)])
def test_every_frequency_has_the_same_power_once_whitened(keeps: float, white: float) -> None:
    """With no white noise added to the estimate, also under a memory that is longer than the single lags."""
    noise = slow_noise(keeps, white)
    assert powers(noise)[0] > 10
    low, high = powers(estimate_whitening([(noise, WHOLE)], NO_WHITE).apply(noise, WHOLE))
    assert low == pytest.approx(1, abs=0.3)
    assert high == pytest.approx(1, abs=0.1)


def test_quick_changes_are_not_trusted_beyond_the_white_noise_that_is_added() -> None:
    """The power at low frequencies is lowered, that at high ones is not raised to the same."""
    noise = slow_noise(0.98, 0.0)
    before, after = powers(noise), powers(estimate_whitening([(noise, WHOLE)]).apply(noise, WHOLE))
    assert after[0] < 0.5 * before[0]
    assert after[1] < 0.1


def test_white_noise_is_hardly_changed() -> None:
    """Coefficients of nothing are nothing."""
    noise = np.random.default_rng(4).standard_normal(20_000)
    white = estimate_whitening([(noise, WHOLE)]).apply(noise, WHOLE)
    assert np.std(white - noise) < 0.02


def test_a_reading_is_whitened_by_those_before_it_in_its_run() -> None:
    """Run by run, of several rows at once, in single precision too; the first of a run vary as the later ones."""
    noise = slow_noise(0.98, 0.3)
    found = estimate_whitening([(noise, WHOLE)])
    rows, runs = noise[:6000].reshape(2, 3000), (slice(0, 5), slice(5, 1200), slice(1200, 3000))
    response, expected = np.append(1.0, -found.coefficients), np.empty_like(rows)
    for run in runs:
        expected[:, run] = lfilter(response, [1.0], rows[:, run])
        expected[:, run][:, : len(found.beginning)] *= found.beginning[: run.stop - run.start]
    np.testing.assert_allclose(found.apply(rows, runs), expected, atol=1e-12)
    single = found.apply(rows.astype(np.float32), runs)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, expected, atol=1e-5)


def test_a_run_begins_anew() -> None:
    """What came before a pause says nothing about what comes after it."""
    noise = slow_noise(0.9, 0.2, 300)
    found = estimate_whitening([(slow_noise(0.9, 0.2), WHOLE)])
    parts = [found.apply(part, (slice(0, 150),)) for part in (noise[:150], noise[150:])]
    np.testing.assert_allclose(found.apply(noise, (slice(0, 150), slice(150, 300))), np.concatenate(parts))


def test_the_first_readings_of_a_run_vary_as_the_later_ones() -> None:
    """They have fewer readings before them, and are scaled to the same variance."""
    noise = slow_noise(0.95, 0.1, 200_000)
    runs = tuple(slice(first, first + 100) for first in range(0, len(noise), 100))
    white = estimate_whitening([(noise, runs)], NO_WHITE).apply(noise, runs).reshape(-1, 100)
    assert np.mean(white[:, :3] ** 2) == pytest.approx(np.mean(white[:, 20:] ** 2), rel=0.05)


def test_a_course_without_noise_is_left_as_it_is() -> None:
    """Nothing is known of it."""
    assert estimate_whitening([(np.zeros(1000), (slice(0, 1000),))]) is NOT_WHITENED
    assert estimate_whitening([]) is NOT_WHITENED
    np.testing.assert_array_equal(NOT_WHITENED.apply(np.arange(5.0), (slice(0, 5),)), np.arange(5.0))


def test_few_readings_have_few_coefficients() -> None:
    """A short recording tells nothing of a long memory."""
    found = estimate_whitening([(slow_noise(0.98, 0.3, 60), (slice(0, 60),))])
    assert isinstance(found, Whitening)
    assert len(found.coefficients) <= 3
