"""Recursions: the same as instant by instant."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion


@pytest.mark.parametrize("columns", [1, 3])
def test_a_recursion_is_that_of_one_instant_after_the_other(columns: int) -> None:
    """With factors that change, one of 1, and one of 0, which begins anew."""
    generator = np.random.default_rng(5)
    factor, added = generator.uniform(0.5, 1, (300, columns)), generator.normal(size=(300, 3))
    factor[100:150], factor[200] = 1.0, 0.0
    expected, state = np.empty_like(added), np.zeros(3)
    for t in range(len(added)):
        state = factor[t] * state + added[t]
        expected[t] = state
    np.testing.assert_allclose(recursion(factor, added), expected, rtol=1e-12, atol=1e-12)
    assert factor[200].tolist() == [0.0] * columns
    np.testing.assert_allclose(expected[200], added[200])
