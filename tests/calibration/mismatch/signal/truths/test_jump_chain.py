"""The hidden chain against sums over all of its paths, and on plateaus."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.truths.jump_chain import CORE, JumpChain, windows_of
from regolithd.calibration.mismatch.signal.truths.mixing_density import MixingDensity, mixing_density

Array = NDArray[np.float64]
ANY = 1000
CHAIN = JumpChain(MixingDensity(np.array([-1.0, 0.0, 2.0]), np.array([0.2, 0.5, 0.3]), np.zeros(3)), 0.7, 0.8)


def by_paths(readings: Array, starts: tuple[int, ...]) -> tuple[Array, Array]:
    """Return mean and variance of the truth by summing over all paths through the chain's values."""
    values, weight = CHAIN.density.at, CHAIN.density.weight
    mean, square, total = np.zeros(len(readings)), np.zeros(len(readings)), 0.0
    for path in product(range(len(values)), repeat=len(readings)):
        chance = 1.0
        for t, k in enumerate(path):
            drawn = weight[k]
            stays = 0.0 if t in starts else CHAIN.persistence * (path[t - 1] == k)
            chance *= drawn if t in starts else stays + (1 - CHAIN.persistence) * drawn
            if np.isfinite(readings[t]):
                chance *= np.exp(-0.5 * ((readings[t] - values[k]) / CHAIN.deviation) ** 2)
        total += chance
        mean += chance * values[list(path)]
        square += chance * values[list(path)] ** 2
    return mean / total, square / total - (mean / total) ** 2


@pytest.mark.parametrize("starts", [(0,), (0, 3)])
def test_the_recursions_are_the_sum_over_all_paths(starts: tuple[int, ...]) -> None:
    """With a reading missing, and where a run begins anew."""
    readings = np.array([0.3, 1.2, np.nan, 2.5, -0.4, 0.1, 1.0])
    mean, variance = CHAIN.posterior(windows_of(readings, np.array(starts), ANY))
    expected, spread = by_paths(readings, starts)
    np.testing.assert_allclose(mean, expected, atol=1e-9)
    np.testing.assert_allclose(variance, spread, atol=1e-9)


def plateaus(count: int) -> Array:
    """Return a truth that is drawn anew at one instant in thirty."""
    random = np.random.default_rng(3)
    drawn = random.random(count) < 1 / 30
    drawn[0] = True
    return random.normal(0, 1, count)[np.maximum.accumulate(np.where(drawn, np.arange(count), 0))]


def test_persistence_is_fitted_and_plateaus_are_found() -> None:
    """The error that remains is little more than that of a plateau's mean."""
    truth = plateaus(6000)
    readings = truth + np.random.default_rng(4).normal(0, 0.3, truth.shape)
    windows = windows_of(readings, np.array([0]), ANY)
    chain = JumpChain(mixing_density(readings, 0.3), 0.9, 0.3).fitted(windows)
    assert chain.persistence == pytest.approx(1 - 1 / 30, abs=0.015)
    mean, variance = chain.posterior(windows)
    assert np.std(mean - truth) < 0.4 * 0.3
    assert np.mean(variance) == pytest.approx(np.mean((mean - truth) ** 2), rel=0.5)


def test_windows_have_every_instant_once() -> None:
    """In order, whether or not the last is full; some of them only where some are wanted."""
    readings = np.arange(3.5 * CORE)
    np.testing.assert_array_equal(windows_of(readings, np.array([0]), ANY).rows, np.arange(len(readings)))
    some = windows_of(readings, np.array([0]), 2).rows
    np.testing.assert_array_equal(some, np.append(np.arange(CORE), np.arange(3 * CORE, len(readings))))


def test_where_windows_are_cut_hardly_shows() -> None:
    """Results of windows and of one recursion over all agree, but for what was read far away."""
    truth = plateaus(2 * CORE)
    readings = truth + np.random.default_rng(5).normal(0, 0.3, truth.shape)
    chain = JumpChain(mixing_density(readings, 0.3), 0.97, 0.3)
    shift = CORE // 2
    mean, _ = chain.posterior(windows_of(readings, np.array([0]), ANY))
    moved, _ = chain.posterior(windows_of(np.append(np.full(shift, np.nan), readings), np.array([0]), ANY))
    np.testing.assert_allclose(mean, moved[shift:], atol=0.05)
