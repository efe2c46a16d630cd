"""The noise is a function of place and seed, has the variance and correlation that it is told, and costs no memory."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.daemon.simulator.spatial_noise import Drops, Wander


def seed(number: int) -> np.random.SeedSequence:
    """Return a seed."""
    return np.random.SeedSequence(number)


def test_it_is_the_same_however_often_and_where_it_is_asked() -> None:
    """A coarse and a fine walk read the same at the same place; a rover that turns back finds its ground again."""
    coarse, fine = (Wander(seed(1), 3, 0.05, keeps=True) for _ in range(2))
    far = [coarse.at(0.5 * k) for k in range(40)]
    near = [fine.at(0.01 * k) for k in range(2000)]
    assert np.array_equal(far, near[::50])
    assert np.array_equal(coarse.at(3.0), far[6])
    forgetful = Wander(seed(1), 3, 0.05)
    forgetful.at(1000.0)
    with pytest.raises(ValueError, match="from now on"):
        forgetful.at(0.0)


def test_variance_and_correlation() -> None:
    """Unit variance everywhere, and a correlation that falls by e over the length."""
    noise = Wander(seed(2), 8, 1.0, keeps=True)
    values = np.array([noise.at(0.1 * k) for k in range(40_000)])
    # 4000 correlation lengths in eight channels: the variance is known to about 1 %.
    assert np.mean(values**2) == pytest.approx(1, abs=0.05)
    assert np.mean(values[10:] * values[:-10]) == pytest.approx(np.exp(-1), abs=0.05)


def test_drops_take_the_share_of_time_that_they_are_told() -> None:
    """So many a second, so long; none where there are none."""
    drops = Drops(seed(3), 4, per_s=0.5, duration_s=0.4)
    share = np.mean([drops.at(0.05 * k) for k in range(40_000)])
    assert share == pytest.approx(0.4 / (0.4 + 2), rel=0.1)
    assert not Drops(seed(3), 4, per_s=0.0, duration_s=0.4).at(1e6).any()
