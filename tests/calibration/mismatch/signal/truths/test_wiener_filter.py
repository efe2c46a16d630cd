"""A Wiener filter has the truth of what goes to and fro, and the noise of whatever has a few oscillations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.truths.smoothing_spline import BRIDGED
from regolithd.calibration.mismatch.signal.truths.stein import squared_error
from regolithd.calibration.mismatch.signal.truths.wiener_filter import (
    HALF_WIDTHS,
    WienerFilter,
    best_filter,
    even_pieces,
    noise_floor,
)

Array = NDArray[np.float64]
COUNT, ERROR = 2000, 0.5
TIME = 0.5 * np.arange(COUNT)
ONE_RUN = np.zeros(COUNT, np.int64)
NONE_EXACT = np.zeros(COUNT, bool)


def strokes() -> Array:
    """Return twelve readings for a stroke, with two harmonics, and something slow."""
    at = 2 * np.pi * TIME / 6.1
    return np.sin(at) + 0.5 * np.sin(2 * at + 0.5) + 0.25 * np.sin(3 * at) + np.sin(TIME / 40)


def readings(seed: int = 1) -> Array:
    """Return them with errors."""
    return strokes() + ERROR * np.random.default_rng(seed).normal(size=COUNT)


def test_strokes_are_told_by_the_strokes_before_and_after() -> None:
    """A tenth of the error's power is left, up to the ends, and Stein's estimate says so."""
    read = readings()
    pieces = even_pieces(read, TIME, ONE_RUN)
    found = best_filter(read, ERROR**2, pieces, NONE_EXACT)
    assert found is not None
    assert found.half_width == HALF_WIDTHS[-1]
    estimate = found.applied(read, pieces, ERROR**2)
    share = ((estimate.mean - strokes()) / ERROR) ** 2
    assert share.mean() < 0.12
    assert share[:20].mean() < 0.4
    assert share[-20:].mean() < 0.4
    told = squared_error(read, ERROR**2, estimate).mean() / ERROR**2
    assert told == pytest.approx(share.mean(), abs=0.08)


def test_what_is_left_follows_no_estimate_of_the_window() -> None:
    """Nothing seems late, as it does beside an estimate that flattens each stroke; mean of twelve recordings."""
    correlations = np.empty((12, 7))
    for seed in range(len(correlations)):
        read = readings(seed)
        pieces = even_pieces(read, TIME, ONE_RUN)
        found = best_filter(read, ERROR**2, pieces, NONE_EXACT)
        assert found is not None
        estimate = found.applied(read, pieces, ERROR**2).mean
        left = (estimate - strokes())[100:-100]
        for lag in range(7):
            correlations[seed, lag] = np.corrcoef(left, estimate[100 - lag : COUNT - 100 - lag])[0, 1]
    assert np.abs(correlations.mean(axis=0)).max() < 0.06


def test_white_noise_alone_is_taken_out_altogether() -> None:
    """A constant has no direction but its mean."""
    read = 3.0 + ERROR * np.random.default_rng(2).normal(size=COUNT)
    pieces = even_pieces(read, TIME, ONE_RUN)
    found = best_filter(read, ERROR**2, pieces, NONE_EXACT)
    assert found is not None
    assert np.std(found.applied(read, pieces, ERROR**2).mean - 3.0) < 0.35 * ERROR


def test_a_blank_has_what_its_neighbours_say() -> None:
    """Single ones and a few in a row cost little; a long stretch belongs to no window."""
    read = readings()
    read[np.random.default_rng(3).choice(COUNT, COUNT // 20, replace=False)] = np.nan
    read[700 : 700 + BRIDGED + 30] = np.nan
    pieces = even_pieces(read, TIME, ONE_RUN)
    assert pieces[0].stop <= 701
    found = best_filter(read, ERROR**2, pieces, NONE_EXACT)
    assert found is not None
    estimate = found.applied(read, pieces, ERROR**2).mean
    assert np.isnan(estimate[705 : 700 + BRIDGED + 25]).all()
    blank = np.isnan(read) & np.isfinite(estimate)
    assert blank.sum() > 50
    assert np.mean((estimate - strokes())[blank] ** 2) < 0.5 * ERROR**2


def test_windows_end_where_a_run_does_and_where_steps_are_uneven() -> None:
    """Of what is shorter than a window nothing is said."""
    time, run = TIME.copy(), ONE_RUN.copy()
    time[900:] += 10.0
    run[1000:] = 1
    pieces = even_pieces(readings(), time, run)
    assert pieces == [slice(0, 900), slice(900, 1000), slice(1000, COUNT)]
    found = WienerFilter.of(np.random.default_rng(0).normal(size=(500, 2 * 60 + 1)), 1.0)
    estimate = found.applied(readings(), pieces, ERROR**2).mean
    assert np.flatnonzero(np.isnan(estimate)).tolist() == list(range(900, 1000))


def test_too_few_readings_have_no_filter() -> None:
    """Each weight is found from several windows."""
    read = readings()[:30]
    assert best_filter(read, ERROR**2, even_pieces(read, TIME[:30], ONE_RUN[:30]), NONE_EXACT[:30]) is None
    assert even_pieces(read[:1], TIME[:1], ONE_RUN[:1]) == []


def test_exact_readings_are_no_part_of_what_is_fitted() -> None:
    """Half of the recording at rest, exactly 0, leaves the strokes as they are."""
    read, exact = readings(), np.zeros(COUNT, bool)
    exact[COUNT // 2 :] = True
    read[exact] = 0.0
    pieces = even_pieces(read, TIME, ONE_RUN)
    found = best_filter(read, ERROR**2, pieces, exact)
    assert found is not None
    left = (found.applied(read, pieces, ERROR**2).mean - strokes())[: COUNT // 2 - 50]
    assert np.mean(left**2) < 0.2 * ERROR**2


def test_noise_is_what_the_quietest_directions_have() -> None:
    """Beside strokes of a few readings, of which differences of every order are full."""
    read = readings() + 30 * np.sin(TIME / 0.35)
    assert np.sqrt(noise_floor(read, even_pieces(read, TIME, ONE_RUN))) == pytest.approx(ERROR, rel=0.15)
    assert noise_floor(np.full(COUNT, np.nan), [slice(0, COUNT)]) == np.inf
    assert noise_floor(read, [slice(0, 20)]) == np.inf
