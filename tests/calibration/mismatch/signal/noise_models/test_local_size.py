"""How large the noise is about each reading."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.noise_models.local_size import noise_size, of_usual_noise


def test_the_size_of_the_noise_is_local_and_never_below_the_usual() -> None:
    """Thrice the noise in one part; a slow course and spells have no part in it."""
    random = np.random.default_rng(0)
    noise = np.concatenate([random.normal(size=1000), 3 * random.normal(size=500), 0.1 * random.normal(size=500)])
    size = noise_size(noise + 5 * np.sin(np.arange(2000) / 300), 32)
    usual = size[:1000].mean()
    assert size[1100:1400].mean() == pytest.approx(3 * usual, rel=0.15)
    assert size[1600:].min() == size.min() > 0.8 * usual
    assert np.all(noise_size(np.zeros(100), 32) == 1)
    assert np.all(noise_size(np.ones(10), 32) == 1)


def test_a_wheel_that_was_never_read_shows_nothing() -> None:
    """No reading has no noise."""
    left = np.zeros((100, 1))
    course, beside = of_usual_noise(left, left, np.zeros(left.shape, bool), left + 1)
    assert len(course) == len(beside) == 0
