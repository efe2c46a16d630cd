"""The penalised spline follows what is there, and its band says how well."""

from __future__ import annotations

import numpy as np
import pytest
from covariate_sums import sums_with

from regolithd.calibration.mismatch.empirical.spline import Spline, fit_spline, knots_of
from regolithd.calibration.mismatch.empirical.sums import profile

X = np.linspace(-2, 3, 120)


def _truth(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.tanh(2 * x) + 0.3 * x**2)


def _fitted(seed: int, noise: float = 0.5) -> Spline:
    sums = sums_with(_truth, X, noise=noise, seed=seed)
    return fit_spline(profile(sums), sums.at, knots_of(sums))


def test_the_band_covers_the_truth_at_nine_knots_in_ten() -> None:
    """Over curves of 40 recordings, averaged over the knots (Nychka, 1988)."""
    covered = []
    for seed in range(40):
        spline = _fitted(seed)
        covered.append(np.abs(spline.value - _truth(spline.at)) < 1.645 * spline.std)
    assert 0.84 < np.mean(covered) < 0.97


def test_without_noise_it_is_the_function() -> None:
    """It bends as much as the recording asks for."""
    spline = _fitted(1, noise=0.01)
    assert np.max(np.abs(spline.value - _truth(spline.at))) < 0.05


def test_noise_alone_gives_no_bend_and_no_evidence() -> None:
    """Of nothing, the curve is as good as zero."""
    sums = sums_with(np.zeros_like, X, seed=3)
    spline = fit_spline(profile(sums), sums.at, knots_of(sums))
    assert np.max(np.abs(spline.value)) < 0.1
    assert spline.evidence < 0


def test_knots_leave_out_the_outermost_readings() -> None:
    """Two readings far away do not move the ends of the range."""
    sums = sums_with(_truth, np.concatenate((X, [50.0])))
    readings = sums.readings.copy()
    readings[-1] = 2
    assert knots_of(type(sums)(**{**vars(sums), "readings": readings}))[-1] == pytest.approx(3, abs=0.1)
