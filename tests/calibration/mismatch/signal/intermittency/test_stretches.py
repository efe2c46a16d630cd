"""Stretches of readings."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches


def test_stretches_begin_and_end_where_it_is_true() -> None:
    """Also at the ends."""
    assert stretches(np.array([True, False, True, True])) == [(0, 1), (2, 4)]
    assert stretches(np.zeros(3, np.bool_)) == []
