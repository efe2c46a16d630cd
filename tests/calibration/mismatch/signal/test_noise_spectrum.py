"""The spectrum of noise as white noise and first-order processes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.fft import dct
from wandering_noise import READINGS, noise

from regolithd.calibration.mismatch.signal.noise_spectrum import Bands, NoiseSpectrum, cosine_transform

if TYPE_CHECKING:
    from numpy.typing import NDArray


def fitted_spectrum(values: NDArray[np.float64]) -> NoiseSpectrum:
    """Return the spectrum of readings that followed each other, shape (reading,)."""
    bands = Bands.of(len(values))
    return bands.fitted(bands.products(values[None])[:, 0, 0])


@pytest.mark.parametrize("time", [2.0, 20.0, 60.0])
def test_slow_noise_has_its_long_run_variance(time: float) -> None:
    """The spectrum at a few cycles in the recording is that of the process, in the median within a third."""
    cycles, kept = 5, np.exp(-1 / time)
    true = 0.5 + 0.5 * (1 - kept**2) / np.abs(1 - kept * np.exp(-2j * np.pi * cycles / READINGS)) ** 2
    found = [fitted_spectrum(noise(time, seed)) for seed in range(12)]
    band = found[0].bands.edges.index(2 * cycles)  # two coefficients for each cycle, and there one in a band
    assert np.median([each.level[band] for each in found]) / true == pytest.approx(1.0, abs=0.35)


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
