"""Columns that are late: straight lines between readings, in each run by itself."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.data.recording import Recording
from regolithd.calibration.mismatch.problem.delayed import shifted

DRAWN = np.random.default_rng(0)
RUN = np.repeat([0, 1, 2], [60, 39, 1])
TIME_S = np.cumsum(DRAWN.uniform(0.1, 0.3, 100))
VALUES = DRAWN.normal(size=(100, 3))
VALUES[5:9, 1] = np.nan
RECORDING = Recording(TIME_S, RUN, (1, 2, 3), {})


@pytest.mark.parametrize("by_s", [0.0, 0.25, -0.4, 2.0, -2.0, 100.0, -100.0])
def test_a_column_is_moved_on_straight_lines(by_s: float) -> None:
    """With blanks and without them; ends are held, blanks stay, and a run of one reading is as it was."""
    found = shifted(RECORDING, VALUES, by_s)
    for here in (RUN == 0, RUN == 1):
        for wheel in range(3):
            known = here & np.isfinite(VALUES[:, wheel])
            expected = np.interp(TIME_S[known] + by_s, TIME_S[known], VALUES[known, wheel])
            np.testing.assert_allclose(found[known, wheel], expected, rtol=1e-14)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(VALUES))
    np.testing.assert_array_equal(found[-1], VALUES[-1])
