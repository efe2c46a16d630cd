"""Quantiles of χ²: those of SciPy."""

from __future__ import annotations

import pytest
from scipy.special import chdtrc, chdtri

from regolithd.calibration.mismatch.signal.chi_squared import quantile, survival


@pytest.mark.parametrize("degrees", [1, 2, 3, 4, 7, 20, 61])
def test_agrees_with_scipy(degrees: int) -> None:
    """Odd and even degrees of freedom, few and many, at levels near and far."""
    assert survival(degrees, 12.5) == pytest.approx(chdtrc(degrees, 12.5), rel=1e-13)
    for level in (0.5, 0.01, 1e-6):
        assert quantile(degrees, level) == pytest.approx(chdtri(degrees, level), rel=1e-12)
