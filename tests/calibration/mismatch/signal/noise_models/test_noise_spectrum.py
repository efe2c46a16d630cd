"""The spectrum of noise as white noise and first-order processes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.optimize import nnls
from wandering_noise import READINGS, noise

from regolithd.calibration.mismatch.signal.noise_models.noise_spectrum import (
    Bands,
    _least_not_below_zero,
    cosine_transform,
    likeliest_powers,
)

Array = NDArray[np.float64]


def power_of(bands: Bands, values: Array) -> Array:
    """Return the sums of squared coefficients of readings that followed each other (reading,), in each band."""
    return bands.products(cosine_transform(values[None]))[:, 0, 0]


def fitted(bands: Bands, power: Array, free: Array | None = None, start: Array | None = None) -> Array:
    """Return the likeliest powers of one course."""
    free, begin = bands.count if free is None else free, None if start is None else start[None]
    return likeliest_powers(bands.shapes[None], power[None], free[None], begin)[0]


def fitted_level(values: Array) -> Array:
    """Return the likeliest spectrum of readings that followed each other, shape (band,)."""
    bands = Bands.of(len(values))
    return fitted(bands, power_of(bands, values)) @ bands.shapes


@pytest.mark.parametrize("time", [2.0, 20.0, 60.0])
def test_slow_noise_has_its_long_run_variance(time: float) -> None:
    """The spectrum at a few cycles in the recording is that of the process, in the median within a third."""
    cycles, kept = 5, np.exp(-1 / time)
    true = 0.5 + 0.5 * (1 - kept**2) / np.abs(1 - kept * np.exp(-2j * np.pi * cycles / READINGS)) ** 2
    found = [fitted_level(noise(time, seed)) for seed in range(12)]
    band = Bands.of(READINGS).edges.index(2 * cycles)  # two coefficients for each cycle, and there one in a band
    assert np.median([each[band] for each in found]) / true == pytest.approx(1.0, abs=0.35)


def test_readings_in_another_unit_have_the_same_spectrum() -> None:
    """Its powers are in the square of that unit, and the logarithm of the determinant tells it."""
    bands, values = Bands.of(READINGS), noise(10.0, 1)
    one, other = (fitted(bands, power_of(bands, each)) for each in (values, 1000 * values))
    np.testing.assert_allclose(1e6 * one, other, rtol=1e-6, atol=1e-3)
    of_one, of_other = (float(bands.count @ np.log(each @ bands.shapes)) for each in (one, other))
    assert of_other - of_one == pytest.approx(2 * READINGS * np.log(1000), rel=1e-6)


@pytest.mark.parametrize("time", [2.0, 60.0])
def test_no_other_powers_are_likelier(time: float) -> None:
    """Where a power is above 0 the likelihood has no slope along it, and where it is 0, it falls."""
    wave = 2 * np.cos(4 * np.pi * np.arange(READINGS) / READINGS)
    bands = Bands.of(READINGS)
    power = power_of(bands, noise(time, 0) + wave)
    found = fitted(bands, power)
    level = found @ bands.shapes
    slope = bands.shapes @ ((power / level - bands.count) / level)
    along = slope * power.sum() / READINGS
    assert np.all(along < 1.0)
    assert np.all(np.abs(along[found > 1e-3]) < 1.0)


def test_the_search_may_begin_anywhere() -> None:
    """The likeliest spectrum of other readings, and one without slow noise, lead to the same one."""
    bands = Bands.of(READINGS)
    power, other = (power_of(bands, noise(time, seed)) for time, seed in ((60.0, 0), (2.0, 1)))
    found = fitted(bands, power)
    quick = np.where(bands.times > 0, 0.0, 1.0)
    for start in (quick, fitted(bands, other)):
        again = fitted(bands, power, start=start)
        np.testing.assert_allclose(again @ bands.shapes, found @ bands.shapes, rtol=0.01)


def test_what_a_fit_takes_is_no_power() -> None:
    """Where a fit left nothing of the first bands' coefficients, the spectrum there is that of noise alone."""
    bands = Bands.of(READINGS)
    power = power_of(bands, noise(20.0, 0))
    free = np.where(np.arange(len(power)) < 8, 0.0, bands.count)
    kept = fitted(bands, np.where(free > 0, power, 0.0), free, np.ones(len(bands.times)))
    np.testing.assert_allclose(kept @ bands.shapes, fitted(bands, power) @ bands.shapes, rtol=0.35)


def test_zeros_have_no_power() -> None:
    """A course that is 0 has a spectrum of 0."""
    bands = Bands.of(READINGS)
    assert not fitted(bands, power_of(bands, np.zeros(READINGS))).any()


@pytest.mark.parametrize("count", [1, 2, 7, 8, 101])
def test_the_cosine_transform_is_that_of_scipy(count: int) -> None:
    """Of an even and of an odd number of readings, and of several series."""
    series = np.random.default_rng(count).standard_normal((3, count))
    np.testing.assert_allclose(cosine_transform(series), dct(series, axis=-1, norm="ortho"), atol=1e-12)


def test_courses_together_are_as_each_alone() -> None:
    """Also where one has fewer bands, of which the others have no coefficient."""
    alone = [Bands.of(count) for count in (READINGS, READINGS // 2)]
    powers = [
        power_of(each, noise(time, seed)[: each.edges[-1]])
        for seed, (each, time) in enumerate(zip(alone, (20.0, 2.0), strict=True))
    ]
    shape = 2, len(alone[0].times), len(alone[0].count)
    shapes, power, free = np.zeros(shape), np.zeros(shape[::2]), np.zeros(shape[::2])
    for place, (each, of_course) in enumerate(zip(alone, powers, strict=True)):
        shapes[place, : len(each.times), : len(each.count)] = each.shapes
        shapes[place, :, len(each.count) :] = 1.0
        power[place, : len(each.count)], free[place, : len(each.count)] = of_course, each.count
    together = likeliest_powers(shapes, power, free)
    for found, each, of_course in zip(together, alone, powers, strict=True):
        alone_level = fitted(each, of_course) @ each.shapes
        np.testing.assert_allclose(found[: len(each.times)] @ each.shapes, alone_level, rtol=0.01)


def test_powers_that_are_0_are_found_where_spectra_are_nearly_the_same() -> None:
    """The least of a quadratic over numbers that are not below 0 is that of SciPy, of each of many."""
    rng, shapes = np.random.default_rng(1), Bands.of(READINGS).shapes
    roots = [shapes / rng.uniform(0.2, 5.0, shapes.shape[1]) for _ in range(200)]
    rights = [rng.normal(size=shapes.shape[1]) for _ in roots]
    matrix = np.array([root @ root.T for root in roots])
    right = np.array([root @ values for root, values in zip(roots, rights, strict=True)])
    found = _least_not_below_zero(matrix, right, np.ones(right.shape, bool))
    expected = [nnls(root.T, values)[0] for root, values in zip(roots, rights, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-6)
