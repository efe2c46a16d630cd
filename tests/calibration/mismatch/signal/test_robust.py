"""The robust standard deviation is that of the bulk."""

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.robust import robust_std


def test_readings_far_away_do_not_move_it() -> None:
    """Of normal values it is their standard deviation, with a tenth of them replaced too."""
    values = np.random.default_rng(0).normal(5, 2, 100_000)
    assert robust_std(values) == pytest.approx(2, rel=0.02)
    values[::10] = 1e6
    assert robust_std(values) == pytest.approx(2, rel=0.2)
    assert robust_std(np.zeros(0)) == 0.0
