"""The spectrum of noise as white noise and first-order processes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.fft import dct
from scipy.signal import lfilter

from regolithd.calibration.mismatch.signal.noise_spectrum import cosine_transform, fitted_spectrum

if TYPE_CHECKING:
    from numpy.typing import NDArray

READINGS = 6000


def noise(time: float, seed: int, white: float = 0.5) -> NDArray[np.float64]:
    """Return noise of variance 1 of which a part has this correlation time [readings]."""
    rng = np.random.default_rng(seed)
    kept = np.exp(-1 / time)
    slow = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(READINGS + 2000))[2000:]
    return np.asarray(np.sqrt(white) * rng.standard_normal(READINGS) + np.sqrt(1 - white) * slow)


@pytest.mark.parametrize("time", [2.0, 20.0, 60.0])
def test_slow_noise_has_its_long_run_variance(time: float) -> None:
    """The spectrum at a few cycles in the recording is that of the process, in the median within a third."""
    frequency = np.array([5 / READINGS])
    kept = np.exp(-1 / time)
    true = 0.5 + 0.5 * (1 - kept**2) / np.abs(1 - kept * np.exp(-2j * np.pi * frequency)) ** 2
    found = [fitted_spectrum(noise(time, seed)).at(frequency) for seed in range(12)]
    assert np.median(found) / float(true[0]) == pytest.approx(1.0, abs=0.35)


def test_readings_in_another_unit_have_the_same_spectrum() -> None:
    """Its powers are in the square of that unit, and the logarithm of the determinant tells it."""
    one, other = fitted_spectrum(noise(10.0, 1)), fitted_spectrum(1000 * noise(10.0, 1))
    np.testing.assert_allclose(1e6 * one.powers, other.powers, rtol=1e-6, atol=1e-3)
    assert other.log_determinant - one.log_determinant == pytest.approx(2 * READINGS * np.log(1000), rel=1e-6)


def test_zeros_have_no_power() -> None:
    """A course that is 0 has a spectrum of 0."""
    assert not fitted_spectrum(np.zeros(READINGS)).powers.any()


@pytest.mark.parametrize("count", [1, 2, 7, 8, 101])
def test_the_cosine_transform_is_that_of_scipy(count: int) -> None:
    """Of an even and of an odd number of readings, and of several series."""
    series = np.random.default_rng(count).standard_normal((3, count))
    np.testing.assert_allclose(cosine_transform(series), dct(series, axis=-1, norm="ortho"), atol=1e-12)
