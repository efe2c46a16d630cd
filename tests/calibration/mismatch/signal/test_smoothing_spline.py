"""Smoothing splines: the same as dense linear algebra, and near the truth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.smoothing_spline import (
    CORE,
    MOST_FITTED,
    ORDERS,
    SmoothingSpline,
    best_spline,
    fitted_rows,
    stretches,
)

Array = NDArray[np.float64]
COUNT = 400
TIME = 0.02 * np.arange(COUNT)


def dense(readings: Array, spline: SmoothingSpline, parts: list[Array]) -> tuple[Array, Array]:
    """Return the posterior mean, and variance over the error's, by the whole inverse matrix."""
    known = np.isfinite(readings)
    precision, first = np.diag(known.astype(np.float64)), 0
    for times in parts:
        rows = np.diff(np.eye(len(times)), spline.order, axis=0)
        there = slice(first, first + len(times))
        precision[there, there] += spline.penalty * rows.T @ rows
        first += len(times)
    inverse = np.linalg.inv(precision)
    return inverse @ np.where(known, readings, 0.0), np.diag(inverse)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("penalty", [0.3, 30.0])
def test_a_spline_is_the_posterior_mean_of_integrated_noise(order: int, penalty: float) -> None:
    """With blanks, and two runs; the variance as it is away from their ends and the blanks."""
    random = np.random.default_rng(1)
    readings = np.sin(TIME) + random.normal(0, 0.1, COUNT)
    readings[200:203] = np.nan
    parts = [TIME[:100], TIME[100:]]
    spline = SmoothingSpline(order, penalty)
    mean, share = dense(readings, spline, parts)
    found = spline.estimate(readings, 0.1, parts)
    np.testing.assert_allclose(found.mean, mean, atol=1e-6)
    np.testing.assert_allclose(found.variance[40:60], 0.01 * share[40:60], rtol=1e-3)


@pytest.mark.parametrize("order", ORDERS)
def test_a_polynomial_below_the_order_stays(order: int) -> None:
    """Its differences of that order are 0, also where the steps of time vary by a third."""
    times = np.cumsum(np.random.default_rng(2).uniform(0.8, 1.2, COUNT))
    polynomial = 3.0 + 0.2 * times + (0.01 * times**2 if order == 3 else 0.0)
    found = SmoothingSpline(order, 1e3).estimate(polynomial, 1.0, [times])
    np.testing.assert_allclose(found.mean, polynomial, rtol=1e-6)


def test_nothing_is_smoothed_across_a_gap_or_a_new_run() -> None:
    """A level that is another after a gap of time, or in the next run, keeps its step."""
    level = np.where(np.arange(COUNT) < 150, 0.0, 5.0)
    gap = np.where(np.arange(COUNT) < 150, TIME, TIME + 100.0)
    runs = stretches(TIME, np.where(np.arange(COUNT) < 150, 0, 1))
    for parts in ([gap], runs):
        np.testing.assert_allclose(SmoothingSpline(2, 1e3).estimate(level, 1.0, parts).mean, level, atol=1e-9)
    smeared = SmoothingSpline(2, 1e3).estimate(level, 1.0, [TIME]).mean
    assert np.max(np.abs(smeared - level)) > 1


def test_times_that_do_not_advance_are_no_error() -> None:
    """Two rows at one time have no difference between them."""
    times = np.repeat(TIME[: COUNT // 2], 2)
    found = SmoothingSpline(3, 10.0).estimate(np.ones(COUNT), 1.0, [times, np.zeros(0)])
    np.testing.assert_allclose(found.mean, 1.0)


def test_the_best_spline_is_nearly_that_of_who_knows_the_truth() -> None:
    """Its mean square error is within a tenth of the least among all that are tried."""
    truth = np.sin(2 * np.pi * 0.5 * 0.02 * np.arange(4000))
    readings = truth + np.random.default_rng(3).normal(0, 0.05, 4000)
    parts = [0.02 * np.arange(4000)]

    def error(spline: SmoothingSpline) -> float:
        return float(np.mean((spline.estimate(readings, 0.05, parts).mean - truth) ** 2))

    chosen = best_spline(readings, 0.05, parts)
    tried = [SmoothingSpline(order, penalty) for order in ORDERS for penalty in 10.0 ** np.arange(-1, 6.1, 0.5)]
    assert error(chosen) < 1.1 * min(map(error, tried))
    assert error(chosen) < 0.1 * 0.05**2


def test_a_long_recording_is_fitted_in_few_parts() -> None:
    """From its start to its end, none longer than another; a short one as a whole."""
    parts = fitted_rows(100 * CORE + 7)
    assert len(parts) == MOST_FITTED
    assert (parts[0].start, parts[-1].stop) == (0, 100 * CORE)
    assert fitted_rows(CORE - 1) == [slice(0, CORE - 1)]
