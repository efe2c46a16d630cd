"""The spectrum of noise as white noise and first-order processes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import lfilter

from regolithd.calibration.mismatch.signal.noise_spectrum import fitted_spectrum, gain_of_columns

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


def test_a_curve_through_slow_noise_hardly_makes_it_likelier() -> None:
    """Eight waves gain about as much as eight coefficients do by chance; of a wave that is there, far more."""
    along = np.pi * np.arange(READINGS) / READINGS
    waves = np.cos(np.outer(along, np.arange(8)))

    by_chance = [gain_of_columns([noise(20.0, seed)], [waves.T]) for seed in range(12)]
    assert np.mean(by_chance) < 12
    assert max(by_chance) < 24
    assert gain_of_columns([noise(20.0, 0) + np.cos(4 * along)], [waves.T]) > 40


def test_each_course_has_noise_of_its_own() -> None:
    """A step in small quick noise is as clear beside another course, whose noise is slow and large, as alone."""
    quick, slow = noise(2.0, 1), 100 * noise(60.0, 2)
    step = np.where(np.arange(READINGS) > READINGS / 2, 1.0, -1.0)[None]
    alone = gain_of_columns([quick + 0.3 * step[0]], [step])
    assert alone > 40
    assert gain_of_columns([quick + 0.3 * step[0], slow], [step, step]) == pytest.approx(alone, rel=0.1)
    assert gain_of_columns([quick + 0.3 * step[0], slow], [step, 0 * step]) == pytest.approx(alone, rel=1e-6)


def test_readings_in_another_unit_are_as_likely() -> None:
    """But for the logarithm of the unit: what columns gain is the same."""
    one, other = fitted_spectrum(noise(10.0, 1)), fitted_spectrum(1000 * noise(10.0, 1))
    np.testing.assert_allclose(1e6 * one.powers, other.powers, rtol=1e-6, atol=1e-3)
    larger = other.minus_two_log_likelihood - one.minus_two_log_likelihood
    assert larger == pytest.approx(2 * READINGS * np.log(1000), rel=1e-3)


def test_too_few_readings_say_nothing() -> None:
    """Nor do zeros: columns gain nothing."""
    assert fitted_spectrum(np.zeros(READINGS)).minus_two_log_likelihood == 0.0
    for courses in ([], [np.zeros(READINGS)], [np.arange(10.0)]):
        assert gain_of_columns(courses, [np.ones((1, len(values))) for values in courses]) == 0.0


def test_an_offset_is_no_noise() -> None:
    """The mean is power at frequency 0: an offset that a sum of readings shows is told from slow noise."""
    values = noise(20.0, 3)
    ones = np.ones((1, READINGS))
    assert gain_of_columns([values], [ones]) < 8
    assert gain_of_columns([values + 0.6], [ones]) > 20
