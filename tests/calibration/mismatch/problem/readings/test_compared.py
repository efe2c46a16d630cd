"""Blanks are left out, counted and told."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.readings.compared import blanks_of, left_out
from regolithd.calibration.mismatch.problem.readings.outliers import FaultyReadings
from regolithd.calibration.mismatch.problem.simulated import Simulated
from regolithd.calibration.mismatch.thresholds import Thresholds

LIMITS = Thresholds()
COUNT = 1000


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
    after_gap = np.arange(10)[:, None] == 4
    run = Simulated(recording, recording, prediction, {}, none, {"load_N": changed, "slip": none}, after_gap)
    told = left_out(
        "current_A",
        measured,
        run,
        FaultyReadings(none, none, none, none, none, none),
        {"yaw_rate": blank},
        {"yaw_rate": "turning (rad/s)"},
    )
    assert [(each.channel, each.readings) for each in told] == [("current_A", readings) for readings in (2, 1, 1, 3)]
    assert "predicts nothing" in told[0].reason
    assert told[1].reason == "the prediction depends on what the inputs were in a gap of the recording"
    assert told[2].reason == "load_N, which is measured less often, changed between its readings"
    assert told[3].reason == "turning was not measured there"


def test_a_covariate_that_is_known_nowhere_is_left_out() -> None:
    """It costs no reading, and nothing is computed from it."""
    compared = np.ones((COUNT, 2), np.bool_)
    known, never = np.ones((COUNT, 2)), np.full((COUNT, 2), np.nan)
    kept, blanks = blanks_of({"known": known, "never": never}, frozenset(), compared, LIMITS)
    assert list(kept) == ["known"]
    assert not blanks
