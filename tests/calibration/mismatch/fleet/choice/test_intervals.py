"""Intervals over a fleet: of sizes that differ from recording to recording, and of the date of an onset."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fleet import DRAG, WAVE, WEAR, drive, equations_of, on_both, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.intervals import onset_places, size_stds
from regolithd.calibration.mismatch.thresholds import THRESHOLDS


def test_a_size_that_is_the_same_everywhere_has_the_noise_s_error() -> None:
    """The sandwich estimator may be larger by chance, never smaller."""
    of = equations_of([drive(n, on_both(1, 0.2)) for n in range(8)], (0,) * 8)
    fit = of.fit((term(DRAG, Course("always")),))
    stds, noise = size_stds(of, fit), np.sqrt(np.diag(fit.covariance))
    assert np.all(stds >= noise)
    assert stds[-1] < 2 * noise[-1]


@pytest.mark.parametrize("sizes", [(0.1, 0.3, 0.2, 0.4, 0.15, 0.35), (0.1, 0.4)])
def test_a_size_that_differs_between_recordings_has_the_error_of_their_mean(sizes: tuple[float, ...]) -> None:
    """Their standard deviation over the root of their number, down to two of them."""
    of = equations_of([drive(n, on_both(1, size)) for n, size in enumerate(sizes)], (0,) * len(sizes))
    fit = of.fit((term(DRAG, Course("always")),))
    assert size_stds(of, fit)[-1] == pytest.approx(np.std(sizes, ddof=1) / np.sqrt(len(sizes)), rel=0.15)


def test_of_a_single_recording_the_error_is_the_noise_s() -> None:
    """One recording says nothing of the differences between recordings."""
    of = equations_of([drive(0, on_both(1, 0.2))], (0,))
    fit = of.fit((term(DRAG, Course("always")),))
    np.testing.assert_allclose(size_stds(of, fit), np.sqrt(np.diag(fit.covariance)))


@pytest.mark.parametrize(("size", "first", "last"), [(0.3, 4, 4), (0.012, 1, 7)])
def test_a_large_effect_has_one_date_and_a_small_one_several(size: float, first: int, last: int) -> None:
    """All dates with which Δχ² falls less than a 90 % interval allows."""
    of = equations_of([drive(n, on_both(1, size) if n >= 4 else None) for n in range(8)], (0,) * 8)
    fit = of.fit((term(WAVE, Course("always")), term(DRAG, Course("since", 4))))
    found = onset_places(of, fit, 1)
    assert first <= found[0] <= 4 <= found[1] <= last
    assert (found[0] < found[1]) == (first < last)


def test_dates_within_the_interval_have_a_fall_below_its_limit() -> None:
    """And the next ones a larger one; growth counts with the power that fits best."""
    of = equations_of([drive(n, {(2, 0): 0.02 * max(n - 2, 0)}) for n in range(8)], (0,) * 8)
    fit = of.fit((term(WEAR, Course("growing", 3), wheels=(0,)),))
    first, last = onset_places(of, fit, 0)
    gains = {}
    for begins in range(1, 8):
        courses = [Course("since", begins), *(Course("growing", begins, power) for power in (0.5, 1.0, 2.0))]
        gains[begins] = max(of.fit((replace(fit.terms[0], course=course),)).delta_chi2 for course in courses)
    within = [begins for begins, gain in gains.items() if gain >= max(gains.values()) - THRESHOLDS.onset_fall]
    assert (first, last) == (within[0], within[-1])
    assert first <= 3 <= last
    assert last < 7
