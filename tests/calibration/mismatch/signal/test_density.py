"""Quantiles of densities whose quantiles are known."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.density import quantiles


def test_a_normal_density_has_its_quantiles() -> None:
    """Whatever it is multiplied by."""
    grid = np.linspace(-6, 6, 601)
    density = 7 * np.exp(-(grid**2) / 2)
    assert quantiles(grid, density, (0.05, 0.5, 0.95)) == pytest.approx([-1.645, 0.0, 1.645], abs=2e-3)


def test_a_density_at_one_place_has_its_quantiles_there() -> None:
    """Its mass is centred on the place."""
    assert quantiles(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 0.0]), (0.5,)) == [2.0]
