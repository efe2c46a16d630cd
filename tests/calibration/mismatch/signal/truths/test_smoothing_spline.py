"""Smoothing splines: the same as dense linear algebra, and near the truth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.truths.smoothing_spline import (
    CORE,
    HEAVY_ORDERS,
    HEAVY_WIDTHS,
    MOST_FITTED,
    ORDERS,
    WIDTHS,
    SmoothingSpline,
    best_spline,
    differences,
    fitted_rows,
    with_fixed_weights,
)
from regolithd.calibration.mismatch.signal.truths.stein import squared_error

Array = NDArray[np.float64]
COUNT = 400
TIME = 0.02 * np.arange(COUNT)


ONE_RUN = np.zeros(COUNT, np.int64)


def dense(readings: Array, spline: SmoothingSpline, run: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the posterior mean, and variance over the error's, by the whole inverse matrix."""
    known = np.isfinite(readings)
    rows = np.diff(np.eye(len(readings)), spline.order, axis=0)
    rows[np.any([run[spline.order :] != run[k : len(run) - spline.order + k] for k in range(spline.order)], axis=0)] = 0
    inverse = np.linalg.inv(np.diag(known.astype(np.float64)) + spline.penalty * rows.T @ rows)
    return inverse @ np.where(known, readings, 0.0), np.diag(inverse)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("width", [0.8, 2.2])
def test_a_spline_is_the_posterior_mean_of_integrated_noise(order: int, width: float) -> None:
    """With blanks, and two runs; the variance as it is away from their ends and the blanks."""
    random = np.random.default_rng(1)
    readings = np.sin(TIME) + random.normal(0, 0.1, COUNT)
    readings[200:203] = np.nan
    run = np.repeat([0, 1], [100, COUNT - 100])
    spline = SmoothingSpline(order, width)
    mean, share = dense(readings, spline, run)
    found = spline.estimate(readings, 0.1, differences(TIME, run, order))
    np.testing.assert_allclose(found.mean, mean, atol=1e-4)
    np.testing.assert_allclose(found.variance[40:60], 0.01 * share[40:60], rtol=1e-3)


@pytest.mark.parametrize("order", ORDERS)
def test_a_polynomial_below_the_order_stays(order: int) -> None:
    """Its differences of that order are 0, also where the steps of time vary by a fifth."""
    times = np.cumsum(np.random.default_rng(2).uniform(0.8, 1.2, COUNT))
    polynomial = 3.0 + 0.2 * times + (0.01 * times**2 if order > 2 else 0.0)
    for heavy in (False, True):
        found = SmoothingSpline(order, 4.0, heavy).mean(polynomial, 1.0, differences(times, ONE_RUN, order))
        np.testing.assert_allclose(found, polynomial, rtol=1e-5)


def test_nothing_is_smoothed_across_a_gap_or_a_new_run() -> None:
    """A level that is another after a gap of time, or in the next run, keeps its step."""
    level = np.where(np.arange(COUNT) < 150, 0.0, 5.0)
    gap = differences(np.where(level == 0, TIME, TIME + 100.0), ONE_RUN, 2)
    runs = differences(TIME, np.where(level == 0, 0, 1), 2)
    for rows in (gap, runs):
        np.testing.assert_allclose(SmoothingSpline(2, 5.6).mean(level, 1.0, rows), level, atol=1e-9)
    smeared = SmoothingSpline(2, 5.6).mean(level, 1.0, differences(TIME, ONE_RUN, 2))
    assert np.max(np.abs(smeared - level)) > 1


def test_times_that_do_not_advance_are_no_error() -> None:
    """Two rows at one time have no difference between them; nor have two rows in all."""
    times = np.repeat(TIME[: COUNT // 2], 2)
    np.testing.assert_allclose(SmoothingSpline(3, 1.5).mean(TIME, 1.0, differences(times, ONE_RUN, 3)), TIME)
    assert differences(TIME[:2], ONE_RUN[:2], 2).shape == (0, 3)


def test_a_long_blank_is_no_error() -> None:
    """Whatever the order and the width; what was read on either side stays."""
    readings = np.where((np.arange(COUNT) > 100) & (np.arange(COUNT) < 300), np.nan, 2.0)
    for order, width, heavy in ((2, 10.0, True), (3, 10.0, True), (5, 5.0, False)):
        rows = differences(TIME, ONE_RUN, order)
        found = SmoothingSpline(order, width, heavy).mean(readings, 0.1, rows)
        np.testing.assert_allclose(found[np.isfinite(readings)], 2.0, rtol=1e-4)


def corners() -> Array:
    """Return a speed in ramps, dwells and cruises."""
    random, at = np.random.default_rng(4), [0.0]
    while len(at) < 4000:
        level, ramp, still = random.choice([0.0, 1.0, -1.0, 0.5]), 15, int(random.integers(30, 90))
        at += np.linspace(at[-1], level, ramp + 1)[1:].tolist() + [level] * still
    return np.array(at[:4000])


OSCILLATION = np.sin(2 * np.pi * 0.5 * 0.02 * np.arange(4000))


@pytest.mark.parametrize(("truth", "heavy"), [(OSCILLATION, False), (corners(), True)], ids=["smooth", "corners"])
def test_the_best_spline_is_nearly_that_of_who_knows_the_truth(truth: Array, heavy: bool) -> None:
    """Normal noise for what has no corners, heavy tails for what has; a tenth of the readings' error is left."""
    readings = truth + np.random.default_rng(3).normal(0, 0.03, 4000)
    time, run = 0.02 * np.arange(4000), np.zeros(4000, np.int64)
    rows = {order: differences(time, run, order) for order in ORDERS}

    def error(spline: SmoothingSpline) -> float:
        return float(np.mean((spline.mean(readings, 0.03, rows[spline.order]) - truth) ** 2))

    chosen = best_spline(readings, 0.03, time, run, np.zeros(4000, np.bool_))
    assert chosen.heavy == heavy
    tried = [SmoothingSpline(order, each) for order in ORDERS for each in WIDTHS[:-4]]
    tried += [SmoothingSpline(order, each, heavy=True) for order in HEAVY_ORDERS for each in HEAVY_WIDTHS]
    assert error(chosen) < 1.2 * min(map(error, tried))
    assert error(chosen) < 0.1 * 0.03**2


@pytest.mark.parametrize("truth", [OSCILLATION, corners()], ids=["smooth", "corners"])
def test_the_change_with_the_readings_tells_the_error_of_heavy_tails(truth: Array) -> None:
    """Also where they do not fit and the error is large; with fixed weights it would seem to be nothing."""
    readings = truth + np.random.default_rng(5).normal(0, 0.03, 4000)
    spline = SmoothingSpline(2, 1.8, heavy=True)
    given = readings, 0.03, differences(0.02 * np.arange(4000), np.zeros(4000, np.int64), 2)
    estimate = spline.estimate(*given)
    true = float(np.mean((estimate.mean - truth) ** 2))
    assert float(np.mean(squared_error(readings, 0.03**2, estimate))) == pytest.approx(true, abs=0.1 * 0.03**2)
    seeming = {each: found for each, found in with_fixed_weights(2, *given) if each.width < 2}
    assert len(seeming) > 1
    for each, found in seeming.items():
        estimate = each.estimate(*given)
        assert np.mean(squared_error(readings, 0.03**2, found)) < np.mean(squared_error(readings, 0.03**2, estimate))


def test_a_long_recording_is_fitted_in_few_parts() -> None:
    """From its start to its end, none longer than another; a short one as a whole."""
    count = 100 * CORE + 7
    rows, runs = fitted_rows(np.zeros(count), np.zeros(count, np.int64))
    parts = [rows[runs == number] for number in np.unique(runs)]
    assert len(parts) == MOST_FITTED
    assert all(np.array_equal(part, np.arange(part[0], part[0] + CORE)) for part in parts)
    assert (parts[0][-1] < 25 * CORE, parts[-1][0] >= 75 * CORE) == (True, True)
    assert fitted_rows(np.zeros(CORE - 1), np.zeros(CORE - 1, np.int64))[0].tolist() == list(range(CORE - 1))


def test_what_is_fitted_of_two_runs_is_not_one_stretch() -> None:
    """A part may have the end of one run and the beginning of the next."""
    _, runs = fitted_rows(np.zeros(CORE), np.repeat([0, 1], CORE // 2))
    assert np.flatnonzero(np.diff(runs)).tolist() == [CORE // 2 - 1]


def test_it_is_fitted_where_the_readings_change_most() -> None:
    """The one step of a quarter is in the part that is fitted there, whatever blanks are beside it."""
    readings = np.random.default_rng(0).normal(0, 0.1, 100 * CORE)
    readings[60 * CORE + 100 :] += 5.0
    readings[10 * CORE : 11 * CORE] = np.nan
    rows, _ = fitted_rows(readings, np.zeros(len(readings), np.int64))
    assert rows[2 * CORE : 3 * CORE].tolist() == list(range(60 * CORE, 61 * CORE))
