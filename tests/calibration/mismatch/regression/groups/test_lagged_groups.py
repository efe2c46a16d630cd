"""Lagged terms: the past of the prediction as columns, and what comes later."""

from __future__ import annotations

import numpy as np
from linear_machine import design_of, problem_of, table

from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.regression.groups.lagged_groups import (
    FILTERED,
    LAGGED_ACCELERATION,
    LAGS,
    LEADS,
    differences,
    with_lagged_terms,
)

COUNT = 60
ROWS = np.arange(COUNT)
VALUES = np.random.default_rng(1).normal(size=(COUNT, 1))
RECORDING = from_columns({"t_s": 0.5 * ROWS, "run": (ROWS >= 40).astype(float), "reading_V": VALUES[:, 0]})


def response(lags: tuple[int, ...], heights: np.ndarray) -> np.ndarray:
    """Return an impulse response at every lag up to the last, on straight lines between the lags."""
    return np.interp(np.arange(1, lags[-1] + 1), lags, heights)


def test_columns_are_a_convolution_with_a_piecewise_linear_response() -> None:
    """Of each run by itself, which begins at its first value; less the same response to a constant."""
    heights = np.random.default_rng(2).normal(size=len(LAGS))
    found = sum(h * column for h, column in zip(heights, differences(RECORDING, VALUES, LAGS, 1), strict=True))
    expected = np.zeros(COUNT)
    for row in range(COUNT):
        first = 0 if row < 40 else 40
        for lag, height in enumerate(response(LAGS, heights), 1):
            expected[row] += height * (VALUES[max(row - lag, first), 0] - VALUES[row, 0])
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-12)


def test_what_comes_later_is_the_past_of_the_recording_backwards() -> None:
    """Run by run."""
    backwards = from_columns({"t_s": 0.5 * ROWS, "run": (ROWS >= 20).astype(float), "reading_V": VALUES[::-1, 0]})
    for later, before in zip(
        differences(RECORDING, VALUES, LEADS, -1), differences(backwards, VALUES[::-1], LEADS, 1), strict=True
    ):
        np.testing.assert_allclose(later, before[::-1], atol=1e-12)


def test_nothing_lags_that_does_not_change() -> None:
    """A simulation that predicts a constant has the past of its acceleration alone."""
    groups = with_lagged_terms(design_of(problem_of(table()))).groups
    assert [(group.name, group.coupling) for group in groups] == [(LAGGED_ACCELERATION, FILTERED)]
    assert len(groups[0].columns) == len(LAGS)
    assert len(groups[0].later) == len(LEADS)
