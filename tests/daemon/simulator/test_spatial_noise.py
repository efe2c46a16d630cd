"""Correlated noise and momentary drops: functions of place or time and seed, with the requested statistics."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.daemon.simulator.spatial_noise import CorrelatedNoise, MomentaryDrops


def seed(number: int) -> np.random.SeedSequence:
    """Return a seed."""
    return np.random.SeedSequence(number)


def test_repeated_evaluation_returns_the_same_values() -> None:
    """Coarse and fine sampling agree at the same place, also going back, if the history is kept."""
    coarse, fine = (CorrelatedNoise(seed(1), 3, 0.05, keeps=True) for _ in range(2))
    far = [coarse.at(0.5 * k) for k in range(40)]
    near = [fine.at(0.01 * k) for k in range(2000)]
    assert np.array_equal(far, near[::50])
    assert np.array_equal(coarse.at(3.0), far[6])
    recent_only = CorrelatedNoise(seed(1), 3, 0.05)
    recent_only.at(1000.0)
    with pytest.raises(ValueError, match="no longer kept"):
        recent_only.at(0.0)


def test_variance_and_correlation() -> None:
    """The variance is 1 everywhere, and the correlation falls by a factor e over the correlation length."""
    noise = CorrelatedNoise(seed(2), 8, 1.0, keeps=True)
    values = np.array([noise.at(0.1 * k) for k in range(40_000)])
    # 4000 correlation lengths in eight channels: the variance is known to about 1 %.
    assert np.mean(values**2) == pytest.approx(1, abs=0.05)
    assert np.mean(values[10:] * values[:-10]) == pytest.approx(np.exp(-1), abs=0.05)


def test_drops_have_the_requested_rate_and_duration() -> None:
    """The fraction of time in a drop is duration / (duration + pause), and 0 at rate 0."""
    drops = MomentaryDrops(seed(3), 4, per_s=0.5, duration_s=0.4)
    share = np.mean([drops.at(0.05 * k) for k in range(40_000)])
    assert share == pytest.approx(0.4 / (0.4 + 2), rel=0.1)
    assert not MomentaryDrops(seed(3), 4, per_s=0.0, duration_s=0.4).at(1e6).any()
