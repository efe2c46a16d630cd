"""What columns gain in noise of any spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import chi2
from wandering_noise import READINGS, noise

from regolithd.calibration.mismatch.regression.likelihood.restricted_likelihood import NO_PRIORS, GivenColumns, Priors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ALONG = np.pi * np.arange(READINGS) / READINGS


def gain_of_columns(
    courses: Sequence[Array], columns: Sequence[Array], given: int = 0, priors: Priors = NO_PRIORS
) -> float:
    """Return what the further columns gain whatever their coefficients."""
    fitted_anyway = GivenColumns(courses, [each[:given] for each in columns], priors)
    return fitted_anyway.with_further([each[given:] for each in columns]).gain()


def smooth_gain(reading: Array, curve: Array, roughness: Array) -> tuple[float, int]:
    """Return what a curve's columns gain if they are smooth, and how many numbers that leaves free."""
    return GivenColumns([reading], [curve[:0]]).with_further([curve]).gain_if_smooth(roughness)


@pytest.mark.parametrize(("count", "time"), [(1, 20.0), (8, 20.0), (8, 100.0), (48, 20.0), (48, 100.0)])
def test_by_chance_columns_gain_as_much_as_there_are_of_them(count: int, time: float) -> None:
    """Also a curve of 48 coefficients that follows the noise wherever it is slow: χ² with 48 degrees of freedom."""
    waves = np.cos(np.outer(np.arange(1, count + 1), ALONG))
    gains = [gain_of_columns([noise(time, seed)], [waves]) for seed in range(24)]
    assert np.mean(gains) == pytest.approx(count, abs=3.5 * np.sqrt(2 * count / 24) + 0.1 * count)


def test_a_curve_that_is_there_gains_far_more() -> None:
    """One wave of eight, half as large again as the noise: what those gain by chance in one of 10 000."""
    waves = np.cos(np.outer(np.arange(8), ALONG))
    assert gain_of_columns([noise(20.0, 0) + 1.5 * np.cos(4 * ALONG)], [waves]) > chi2.isf(1e-4, 8)


def test_a_parameter_that_slow_noise_bends_takes_it_up_anyway() -> None:
    """What is fitted anyway gains nothing, and a column that acts as it does gains no more."""
    wave = np.cos(4 * ALONG)[None]
    reading = noise(20.0, 0) + wave[0]
    assert gain_of_columns([reading], [wave]) > 30
    assert gain_of_columns([reading], [np.vstack([wave, wave])], given=1) == pytest.approx(0.0, abs=0.1)


def test_a_prior_leaves_to_a_column_what_it_holds_back() -> None:
    """A parameter that is known firmly explains nothing; one whose mean is the wave leaves nothing to explain."""
    wave = np.cos(4 * ALONG)[None]
    reading, twice = noise(20.0, 0) + wave[0], np.vstack([wave, wave])
    firm, there = (Priors(np.array([1e8]), np.array([mean])) for mean in (0.0, 1.0))
    alone = gain_of_columns([reading], [wave])
    assert gain_of_columns([reading], [twice], 1, firm) == pytest.approx(alone, rel=0.05)
    assert gain_of_columns([reading], [twice], 1, there) < 6


def test_each_course_has_noise_of_its_own() -> None:
    """A step in small quick noise is as clear beside another course, whose noise is slow and large, as alone."""
    quick, slow = noise(2.0, 1), 100 * noise(60.0, 2)
    step = np.where(np.arange(READINGS) > READINGS / 2, 1.0, -1.0)[None]
    alone = gain_of_columns([quick + 0.3 * step[0]], [step])
    assert alone > 40
    assert gain_of_columns([quick + 0.3 * step[0], slow], [step, step]) == pytest.approx(alone, rel=0.1)
    assert gain_of_columns([quick + 0.3 * step[0], slow], [step, 0 * step]) == pytest.approx(alone, rel=0.02)


def test_the_unit_does_not_matter() -> None:
    """Neither of the readings nor of a column."""
    reading, wave = noise(20.0, 3) + 0.5 * np.cos(4 * ALONG), np.cos(4 * ALONG)[None]
    gain = gain_of_columns([reading], [wave])
    assert gain_of_columns([1000 * reading], [wave]) == pytest.approx(gain, rel=1e-6)
    assert gain_of_columns([reading], [1000 * wave]) == pytest.approx(gain, rel=1e-6)


def test_too_few_readings_say_nothing() -> None:
    """Nor do zeros: columns gain nothing."""
    for courses in ([], [np.zeros(READINGS)], [np.arange(10.0)]):
        assert gain_of_columns(courses, [np.ones((1, len(values))) for values in courses]) == 0.0


def test_an_offset_is_no_noise() -> None:
    """The mean is power at frequency 0: an offset that a sum of readings shows is told from slow noise."""
    values, ones = noise(20.0, 3), np.ones((1, READINGS))
    assert gain_of_columns([values], [ones]) < 8
    assert gain_of_columns([values + 0.6], [ones]) > 20


def hats(knots: int) -> Array:
    """Return a curve's columns over the readings, shape (knot, reading)."""
    at = np.linspace(0, knots - 1, READINGS)
    return np.maximum(1 - np.abs(at - np.arange(knots)[:, None]), 0.0)


def if_smooth(reading: Array, knots: int) -> float:
    """Return what a curve gains if it is smooth, less what its free numbers gain by chance."""
    second = np.diff(np.eye(knots), 2, axis=0)
    gain, free = smooth_gain(reading, hats(knots), second.T @ second)
    assert free == 3  # a line's two, and how smooth it is
    return gain - free


@pytest.mark.parametrize("knots", [8, 48])
@pytest.mark.parametrize("time", [2.0, 20.0, 100.0])
def test_by_chance_a_smooth_curve_gains_what_a_line_does(knots: int, time: float) -> None:
    """However many knots it has."""
    gains = [if_smooth(noise(time, seed), knots) for seed in range(24)]
    assert abs(np.mean(gains)) < 3
    assert max(gains) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("knots", [8, 48])
def test_a_smooth_curve_gains_more_than_one_of_any_course(knots: int) -> None:
    """A drift of one arc: less what coefficients gain by chance."""
    reading = noise(20.0, 4) + 0.8 * np.sin(ALONG)
    whatever = gain_of_columns([reading], [hats(knots)]) - knots
    assert if_smooth(reading, knots) > whatever + 3
    assert if_smooth(1000 * reading, knots) == pytest.approx(if_smooth(reading, knots), abs=0.2)


def test_knots_that_no_reading_sees_do_not_matter() -> None:
    """A covariate that leaves out a part of its range."""
    second = np.diff(np.eye(8), 2, axis=0)
    reading, columns = noise(20.0, 4) + 0.8 * np.sin(ALONG), hats(8)
    with_more = np.vstack([columns, np.zeros((3, READINGS))])
    more = np.diff(np.eye(11), 2, axis=0)
    gain, free = smooth_gain(reading, columns, second.T @ second)
    assert smooth_gain(reading, with_more, more.T @ more) == (pytest.approx(gain, abs=0.01), free)
