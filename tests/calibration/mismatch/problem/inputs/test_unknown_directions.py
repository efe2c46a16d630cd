"""Where the sign of a noisy input is not known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.inputs.true_values import FEWEST_AT_REST
from regolithd.calibration.mismatch.problem.inputs.unknown_directions import (
    AT_AN_EDGE,
    LONGEST_START,
    UnknownDirections,
)

Array = NDArray[np.float64]
START, ERROR = np.array([0]), 0.1
SCALE = ReadingScale(ERROR, 0.0, ERROR)


def directions(values: Array, read: Array | None = None) -> UnknownDirections:
    """Return those of one wheel, of whose error smoothing leaves half of the deviation."""
    column = values[:, None]
    return UnknownDirections.of(column, column if read is None else read[:, None], SCALE, 0.5, START)


def test_the_probability_is_that_of_the_other_sign() -> None:
    """By the normal density of what is left at the end of smoothing; 0 where it is clear."""
    found = directions(np.array([1.0, 0.1, -0.2, 1.0, 1.0]))
    assert found.probability[:, 0] == pytest.approx([0, 0.1587, 0.0228, 0, 0], abs=1e-3)
    assert found.readings[:, 0].tolist() == [0, 2, 2, 0, 0]
    one, other = found.ways
    assert one[1:3, 0] == pytest.approx(-other[1:3, 0])
    assert (one[1, 0], one[0, 0], other[0, 0]) == pytest.approx((0.01 * ERROR, 1.0, 1.0))


def test_a_start_from_rest_has_the_direction_of_its_motion() -> None:
    """For as many readings as a start takes; before them it may have crept the other way."""
    values = np.concatenate((np.zeros(5), np.full(30, 0.02), np.full(5, 1.0)))
    found = directions(values)
    assert not found.probability[:5].any()
    assert found.probability[5 : 35 - LONGEST_START, 0].min() > 0.3
    assert not found.probability[35 - LONGEST_START :].any()
    assert found.readings[5, 0] == min(30 - LONGEST_START, FEWEST_AT_REST)


def test_a_recording_that_ends_as_a_motion_begins_does_not_tell_which_way() -> None:
    """No reading is clear."""
    found = directions(np.concatenate((np.zeros(10), [0.02, 0.03])))
    assert found.probability[10:, 0].min() > 0.3


def test_what_seems_to_rest_may_move_at_its_ends() -> None:
    """In the direction of the motion beside it; a sensor that reads exactly 0 is at rest."""
    read = np.concatenate((np.full(6, 1.0), np.full(20, 0.01), np.full(6, -1.0)))
    values = np.where(np.abs(read) < ERROR, 0.0, read)
    found = directions(values, read)
    moving = np.zeros(len(read))
    moving[6 : 6 + AT_AN_EDGE], moving[26 - AT_AN_EDGE : 26] = 1, -1
    np.testing.assert_array_equal(found.probability[:, 0], np.where(moving != 0, 0.5, 0.0))
    np.testing.assert_array_equal(np.sign(found.ways[0] - found.ways[1])[:, 0], moving)
    assert not directions(values, values).probability.any()
