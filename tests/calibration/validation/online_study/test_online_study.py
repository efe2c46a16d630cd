"""The study's shortcuts are exact, and its threshold is the one of a known distribution."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.online.thresholds import OnlineThresholds
from regolithd.calibration.validation.online_study.drives import SoundDrive, other_noise, pieces_of, sound_drive
from regolithd.calibration.validation.online_study.measured import Delay, alarm_for, delay_of, highest
from regolithd.calibration.validation.online_study.picture import picture

LIMITS = OnlineThresholds(alarm=22.0, learning_intervals=4)
ONSET_S = 300.0


@pytest.fixture(scope="module")
def drive() -> SoundDrive:
    """Return a sound drive of eight minutes, of which four are learned from."""
    return sound_drive(5, 1, 480.0, LIMITS)


def test_added_drag_is_what_the_recording_with_it_would_give(drive: SoundDrive) -> None:
    """The residual of each later minute, computed anew from the recording with the drag."""
    current = drive.dragging(3, 0.5, ONSET_S)
    pieces = pieces_of(drive.recording(current), LIMITS.interval_s)
    made = drive.with_current(current)
    for number in (5, 7):
        anew = drive.linearised.interval(pieces[number], pieces[number - 1])
        np.testing.assert_allclose(made[number].residual, anew.residual, atol=1e-12)
    assert np.any(made[7].residual != drive.intervals[7].residual)


def test_other_noise_is_as_strong_as_the_drives_own(drive: SoundDrive) -> None:
    """Only its order is another."""
    noise = drive.trial.current_A - drive.true_current_A
    other = other_noise(np.random.default_rng(1), drive) - drive.true_current_A
    assert np.sort(np.std(other, axis=0)) == pytest.approx(np.sort(np.std(noise, axis=0)))
    assert not np.allclose(other, noise)


def test_drag_as_large_as_the_current_is_reported_at_once(drive: SoundDrive) -> None:
    """Within two minutes, on its wheel."""
    delay = delay_of(drive, 3, 1.0, ONSET_S, LIMITS)
    assert delay.delay_s is not None
    assert delay.delay_s <= 120.0
    assert delay.named
    assert 0 < delay.bound_s < 120.0


def test_a_sound_drive_has_a_statistic_for_each_draw(drive: SoundDrive) -> None:
    """None is reported, however large."""
    assert len(highest(drive, np.random.default_rng(1), 2, LIMITS)) == 2


def test_the_threshold_is_that_of_the_tail() -> None:
    """Drives of two hours whose largest statistics are exponential beyond 10, by 3: one of fifty passes."""
    largest = 10 + np.random.default_rng(2).exponential(3.0, 4000)
    found, error = alarm_for(largest, 2.0)
    assert found == pytest.approx(10 + 3 * np.log(50), abs=3 * error)
    assert error < 0.5


def test_the_picture_has_a_curve_for_each_size() -> None:
    """Also for one that was never reported; and a line of the legend."""
    delays = [Delay(0.1, None, False, 100.0), Delay(0.5, 120.0, True, 60.0), Delay(0.5, 240.0, True, 60.0)]
    drawn = picture(delays, (0.1, 0.5))
    assert [drawn.count(f'"curve size{place}"') for place in (0, 1, 2)] == [2, 2, 0]
