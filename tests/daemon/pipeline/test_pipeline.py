"""When the smoothing of a wheel begins anew."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from regolithd.daemon.pipeline.pipeline import Pipeline

NAN = float("nan")


@pytest.mark.parametrize(
    ("before", "now", "reset", "kept"),
    [
        ([1, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 1], None, [1, 1, 1, 1, 1, 1]),
        ([1, 1, 0, -1, 0, 1], [-1, 0, 1, -1, 0, 1], [1, 1, 1, 0, 0, 0], [-1, 0, 1, -1, 0, 1]),
        ([1, 1, 1, 1, 1, 1], [NAN, 1, 1, 1, 1, 1], None, [1, 1, 1, 1, 1, 1]),
        ([1, 1, 1, 1, 1, 1], [NAN, -1, 1, 1, 1, 1], [0, 1, 0, 0, 0, 0], [1, -1, 1, 1, 1, 1]),
        ([1, -1, 1, 1, 1, 1], [-1, -1, 1, NAN, NAN, NAN], [1, 0, 0, 0, 0, 0], [-1, -1, 1, 1, 1, 1]),
    ],
)
def test_smoothing_begins_anew_where_a_wheel_stops_or_reverses(
    before: list[float], now: list[float], reset: list[int] | None, kept: list[float]
) -> None:
    """A reading that is missing is no stop: the direction before it counts on."""
    told: list[list[bool]] = []
    pipeline = Pipeline.__new__(Pipeline)
    pipeline._smoother = SimpleNamespace(reset=lambda wheels: told.append(wheels.tolist()))  # type: ignore[assignment]
    pipeline._direction = np.array(before, np.float64)
    pipeline._reset_reversed(np.array(now, np.float64))
    assert told == ([] if reset is None else [[bool(each) for each in reset]])
    np.testing.assert_array_equal(pipeline._direction, kept)
