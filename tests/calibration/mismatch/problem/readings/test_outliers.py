"""Only single, isolated readings, codes, a stuck sensor, and readings at a limit are left out."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.problem.readings.outliers import (
    FEWEST_SATURATED,
    NEAR_LIMIT_DEVIATIONS,
    at_common_limit,
    at_one_value,
    at_own_limit,
    codes_in_a_row,
    far_from_prediction,
    isolated_outliers,
    note_on_far_readings,
)
from regolithd.calibration.mismatch.thresholds import Thresholds

LIMITS = Thresholds()
COUNT = 1000


def residual(*far: int, size: float = 60.0) -> np.ndarray:
    """Return normal noise on one wheel with readings far away at these places."""
    values = np.random.default_rng(3).normal(0, 1, (COUNT, 1))
    values[list(far)] = size
    return values


def isolated(values: np.ndarray, run: np.ndarray | None = None) -> np.ndarray:
    """Return which residuals are single outliers."""
    far, runs = far_from_prediction(values, LIMITS), np.zeros(len(values), np.int64) if run is None else run
    return isolated_outliers(far, np.isfinite(values), runs, LIMITS)


def codes(measured: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return which readings with these residuals are codes in a row."""
    far = far_from_prediction(values, LIMITS)
    return codes_in_a_row(measured, far, np.isfinite(values), np.zeros(COUNT, np.int64), LIMITS)


def notes(values: np.ndarray, left: np.ndarray) -> tuple[str, ...]:
    """Return what is told of far residuals that are not left out."""
    far = far_from_prediction(values, LIMITS) & ~left
    return note_on_far_readings("current_A", far, np.isfinite(values), LIMITS)


def outliers(values: np.ndarray, run: np.ndarray | None = None) -> list[int]:
    """Return the places that are left out."""
    return np.flatnonzero(isolated(values, run)).tolist()


def test_a_single_reading_far_away_is_left_out() -> None:
    """On either side of the median, at the ends too."""
    assert outliers(residual(0, 500, 999)) == [0, 500, 999]
    assert outliers(residual(500, size=-60.0)) == [500]


def test_two_neighbours_are_physics() -> None:
    """A hard stop that is met for two readings is compared."""
    assert outliers(residual(500, 501)) == []


def test_neighbours_in_different_runs_are_both_single() -> None:
    """The last reading of a run and the first of the next are not beside each other."""
    assert outliers(residual(499, 500), np.repeat([0, 1], 500)) == [499, 500]


def test_many_single_readings_are_physics() -> None:
    """More than half a percent of a wheel's readings are no faults of the recording."""
    assert len(outliers(residual(*range(0, 100, 20)))) == 5
    assert outliers(residual(*range(0, 120, 20))) == []


@pytest.mark.parametrize("values", [np.full((COUNT, 1), 3.0), np.full((COUNT, 1), np.nan)])
def test_a_constant_residual_has_no_outliers(values: np.ndarray) -> None:
    """Nor has one that was never measured."""
    assert outliers(values) == []


def test_each_wheel_has_its_own_scale() -> None:
    """Newtons beside newton metres: the larger is not an outlier of the smaller."""
    both = np.concatenate((residual(), 1000 * residual()), axis=1)
    assert not isolated(both).any()


def test_codes_of_faults_in_a_row_are_left_out() -> None:
    """Up to five readings far from the prediction and out of the range of all others; six are an event."""
    away = residual(500, 501, 502)
    measured = np.linspace(0.0, 30.0, COUNT)[:, None]
    measured[500:503] = 9999.0
    assert np.flatnonzero(codes(measured, away)).tolist() == [500, 501, 502]
    measured[500:503] = 50.0  # within once more the range, 0 to 60: a high load
    assert not codes(measured, away).any()
    measured[500:506] = 9999.0
    assert not codes(measured, residual(*range(500, 506))).any()


def test_readings_at_a_limit_that_both_have_are_left_out() -> None:
    """And those whose prediction is within the reach of noise; none where noise is added after the limit."""
    random = np.random.default_rng(4)
    current = 4 + np.sin(np.arange(COUNT) / 20)[:, None]
    prediction, noise = np.minimum(current, 4.5), random.normal(0, 0.05, (COUNT, 1))
    measured = np.minimum(current + 0.1 + noise, 4.5)
    left = at_common_limit(measured, prediction, measured - prediction)
    assert left[measured == 4.5].all()
    assert left[prediction == 4.5].all()
    assert not left[prediction < 4.2].any()
    noisy = prediction + noise
    assert not at_common_limit(noisy, prediction, noise).any()
    assert not at_common_limit(measured, current, measured - current).any()  # a limit that is not simulated is physics


def course(noise: float = 0.3, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return a prediction and readings with noise, (time, wheel), of two wheels of which one carries less."""
    truth = 2 + np.sin(np.arange(COUNT) / 20.0)[:, None] * [1.0, 0.8]
    return truth, truth + np.random.default_rng(seed).normal(0, noise, truth.shape)


def test_readings_at_the_end_of_a_sensor_s_range_are_left_out_by_their_prediction() -> None:
    """Whether they are saturated or not, on each wheel that reaches it; what is left has noise of either sign."""
    truth, measured = course()
    limit = float(np.quantile(measured[:, 0], 0.95))
    for sign in (1.0, -1.0):
        clipped = np.minimum(measured, limit)
        found = at_own_limit(sign * clipped, sign * truth, sign * (clipped - truth))
        near = truth > limit - NEAR_LIMIT_DEVIATIONS * 0.3
        assert np.mean(found == near) > 0.95
        assert 0 < found[:, 1].sum() < found[:, 0].sum()
        assert abs(np.mean((clipped - truth)[~found])) < 0.02


@pytest.mark.parametrize("bits", [5, 8, 12])
def test_quantised_readings_are_not_saturated(bits: int) -> None:
    """The furthest value of noise is the rarest."""
    truth, measured = course()
    step = float(np.ptp(measured)) / 2**bits
    read = step * np.rint(measured / step)
    assert not at_own_limit(read, truth, read - truth).any()


def test_where_a_machine_rests_its_reading_is_not_saturated() -> None:
    """One value is predicted there; nor are a few equal readings, those at zero, nor many, which are a limit of it."""
    truth, measured = course(noise=0.01)
    rests = np.where(truth > 2.9, 3.0, truth)
    read = np.where(truth > 2.9, 3.1, measured)
    assert not at_own_limit(read, rests, read - rests).any()
    few = measured.copy()
    few[: FEWEST_SATURATED - 1] = measured.max() + 0.1
    assert not at_own_limit(few, truth, few - truth).any()
    for share in (0.7, 0.97):
        limit = float(np.quantile(measured, share))
        limited = np.minimum(measured, limit) - (limit if share > 0.9 else 0.0)
        shifted = truth - (limit if share > 0.9 else 0.0)
        assert not at_own_limit(limited, shifted, limited - shifted).any()


def stuck(read: np.ndarray, predicted: np.ndarray) -> int:
    """Return how many readings of one wheel are of a stuck sensor."""
    return int(at_one_value(read[:, None], predicted[:, None], np.zeros(len(read), np.int64)).sum())


def test_a_stuck_sensor_is_left_out_and_a_machine_at_rest_is_not() -> None:
    """It repeats one value exactly while the prediction changes by more than its readings scattered before."""
    predicted = 5 + 3 * np.sin(np.arange(COUNT) / 40)
    read = predicted + np.random.default_rng(3).normal(0, 0.3, COUNT)
    assert stuck(read, predicted) == 0
    still = np.where(np.arange(COUNT) >= 800, read[800], read)
    assert stuck(still, predicted) == 200
    assert stuck(still, np.where(np.arange(COUNT) >= 800, 5.0, predicted)) == 0
    assert stuck(np.where(np.arange(COUNT) >= 800, 0.0, read), predicted) == 0


@pytest.mark.parametrize("held", [10, 25])
def test_a_slow_sensor_that_is_held_is_not_stuck(held: int) -> None:
    """Each of its readings is repeated as often."""
    predicted = 5 + 3 * np.sin(np.arange(COUNT) / 200)
    read = np.repeat((predicted + np.random.default_rng(3).normal(0, 0.05, COUNT))[::held], held)[:COUNT]
    assert stuck(read, predicted) == 0


def test_a_few_far_readings_that_are_compared_are_told() -> None:
    """With the cure; not those that are left out, nor where they are so many that they are physics."""
    nothing_left = np.zeros((COUNT, 1), np.bool_)
    (told,) = notes(residual(500, 501), nothing_left)
    assert told.startswith(
        "2 readings of current_A further than 15 standard deviations from the prediction are compared"
    )
    assert "leave the cells empty" in told
    assert not notes(residual(500), residual(500) > 50)
    assert not notes(residual(*range(500, 506)), nothing_left)
