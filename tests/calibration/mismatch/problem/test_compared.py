"""Only single, isolated readings are left out without a reason; blanks are left out, counted and told."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.compared import (
    blanks_of,
    bursts_out_of_range,
    isolated_outliers,
    left_out,
    note_on_far_readings,
)
from regolithd.calibration.mismatch.problem.simulated import Simulated
from regolithd.calibration.mismatch.thresholds import Thresholds

LIMITS = Thresholds()
COUNT = 1000


def residual(*far: int, size: float = 60.0) -> np.ndarray:
    """Return normal noise on one wheel with readings far away at these places."""
    values = np.random.default_rng(3).normal(0, 1, (COUNT, 1))
    values[list(far)] = size
    return values


def outliers(values: np.ndarray, run: np.ndarray | None = None) -> list[int]:
    """Return the places that are left out."""
    found = isolated_outliers(values, np.zeros(len(values), np.int64) if run is None else run, LIMITS)
    return np.flatnonzero(found).tolist()


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
    assert not isolated_outliers(both, np.zeros(COUNT, np.int64), LIMITS).any()


def test_codes_of_faults_in_a_row_are_left_out() -> None:
    """Up to five readings far from the prediction and out of the range of all others; six are an event."""
    run, away = np.zeros(COUNT, np.int64), residual(500, 501, 502)
    measured = np.linspace(0.0, 30.0, COUNT)[:, None]
    measured[500:503] = 9999.0
    assert np.flatnonzero(bursts_out_of_range(measured, away, run, LIMITS)).tolist() == [500, 501, 502]
    measured[500:503] = 50.0  # within once more the range, 0 to 60: a high load
    assert not bursts_out_of_range(measured, away, run, LIMITS).any()
    measured[500:506] = 9999.0
    assert not bursts_out_of_range(measured, residual(*range(500, 506)), run, LIMITS).any()


def test_a_few_far_readings_that_are_compared_are_told() -> None:
    """With the cure; not those that are left out, nor where they are so many that they are physics."""
    nothing_left = np.zeros((COUNT, 1), np.bool_)
    (told,) = note_on_far_readings("current_A", residual(500, 501), nothing_left, LIMITS)
    assert told.startswith(
        "2 readings of current_A further than 15 standard deviations from the prediction are compared"
    )
    assert "leave the cells empty" in told
    assert not note_on_far_readings("current_A", residual(500), residual(500) > 50, LIMITS)
    assert not note_on_far_readings("current_A", residual(*range(500, 506)), nothing_left, LIMITS)


def test_a_partly_blank_covariate_costs_its_readings() -> None:
    """Where it is blank the reading is not compared; it is never taken as zero."""
    compared = np.ones((COUNT, 2), np.bool_)
    yaw = np.ones((COUNT, 2))
    yaw[:300, 0] = np.nan
    kept, blanks = blanks_of({"yaw_rate": yaw}, frozenset(), compared, LIMITS)
    assert kept["yaw_rate"] is yaw
    assert blanks["yaw_rate"].sum() == 300
    assert blanks["yaw_rate"][:300, 0].all()


def test_a_covariate_that_is_never_known_on_a_wheel_costs_nothing() -> None:
    """It says nothing there, and the wheel is compared."""
    temperature = np.ones((COUNT, 2))
    temperature[:, 1] = np.nan
    kept, blanks = blanks_of({"temperature": temperature}, frozenset(), np.ones((COUNT, 2), np.bool_), LIMITS)
    assert list(kept) == ["temperature"]
    assert not blanks


def test_a_covariate_that_is_mostly_blank_is_left_out_as_a_whole() -> None:
    """Rather than most of the recording."""
    pitch = np.full((COUNT, 1), np.nan)
    pitch[:400] = 0.1
    kept, blanks = blanks_of({"pitch": pitch}, frozenset(), np.ones((COUNT, 1), np.bool_), LIMITS)
    assert not kept
    assert not blanks


def test_what_follows_from_a_speed_is_left_out_with_it() -> None:
    """Where the speed is mostly blank, an angle or an acceleration that was completed by it says nothing."""
    compared = np.ones((COUNT, 1), np.bool_)
    speed, known = np.full((COUNT, 1), np.nan), np.ones((COUNT, 1))
    speed[:400] = 0.1
    followers = {"direction": np.sign(speed), "wheel_acceleration": known, "wheel_angle": known}
    kept, blanks = blanks_of({"wheel_speed": speed, **followers, "load": known}, frozenset(), compared, LIMITS)
    assert (list(kept), blanks) == (["load"], {})
    kept, _ = blanks_of({"wheel_acceleration": known}, frozenset(), compared, LIMITS)
    assert list(kept) == ["wheel_acceleration"]


def test_what_does_not_apply_is_no_blank() -> None:
    """The slip of a wheel that stands is undefined, as the simulation says."""
    slip = np.full((COUNT, 1), np.nan)
    slip[:900] = 0.1
    kept, blanks = blanks_of({"slip": slip}, frozenset({"slip"}), np.ones((COUNT, 1), np.bool_), LIMITS)
    assert list(kept) == ["slip"]
    assert not blanks


def test_what_is_left_out_is_counted_with_its_reason() -> None:
    """Predicted nothing, blanks, slower inputs that changed; nothing is listed that left nothing out."""
    measured = np.ones((10, 1))
    prediction = np.ones((10, 1))
    prediction[:2] = np.nan
    none, blank = np.zeros((10, 1), np.bool_), np.zeros((10, 1), np.bool_)
    blank[5:8] = True
    recording = from_columns({"t_s": np.arange(len(measured))})
    changed = np.arange(10)[:, None] == 9
    run = Simulated(recording, recording, prediction, {}, none, {"load_N": changed, "slip": none})
    told = left_out("current_A", measured, run, none, none, {"yaw_rate": blank}, {"yaw_rate": "turning (rad/s)"})
    assert [(each.channel, each.readings) for each in told] == [("current_A", 2), ("current_A", 1), ("current_A", 3)]
    assert "predicts nothing" in told[0].reason
    assert told[1].reason == "load_N, which is measured less often, changed between its readings"
    assert told[2].reason == "turning was not measured there"


def test_a_covariate_that_is_known_nowhere_is_left_out() -> None:
    """It costs no reading, and nothing is computed from it."""
    compared = np.ones((COUNT, 2), np.bool_)
    known, never = np.ones((COUNT, 2)), np.full((COUNT, 2), np.nan)
    kept, blanks = blanks_of({"known": known, "never": never}, frozenset(), compared, LIMITS)
    assert list(kept) == ["known"]
    assert not blanks
