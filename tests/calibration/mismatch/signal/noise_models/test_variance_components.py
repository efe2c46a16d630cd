"""Variance components: a constant noise and a share of a variance that is known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.noise_models.variance_components import LEAST_CONSTANT, variance_components


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_both_parts_are_found(share: float) -> None:
    """Of two courses of readings with another noise each."""
    random = np.random.default_rng(3)
    known = [random.exponential(2.0, 20000), random.exponential(1.0, 20000)]
    noise = [1.0, 3.0]
    squares = [
        (random.normal(size=each.size) * np.sqrt(of + share * each)) ** 2 for each, of in zip(known, noise, strict=True)
    ]
    constant, found = variance_components(squares, known)
    assert found == pytest.approx(share, abs=0.06)
    assert constant == pytest.approx(noise, rel=0.08)


def test_no_more_is_believed_than_was_stated() -> None:
    """Readings that scatter more than the stated errors explain have other reasons for it."""
    random = np.random.default_rng(4)
    known = random.exponential(1.0, 5000)
    _, share = variance_components([(random.normal(size=5000) * np.sqrt(1 + 9 * known)) ** 2], [known])
    assert share == 1.0


def test_a_course_has_some_noise_of_its_own_and_one_without_readings_none() -> None:
    """So that no reading weighs all."""
    known = np.linspace(0.1, 5.0, 400)
    squares = known * np.random.default_rng(5).normal(size=400) ** 2
    constant, _ = variance_components([squares, np.zeros(0)], [known, np.zeros(0)])
    assert constant[0] >= LEAST_CONSTANT * np.mean(squares)
    assert constant[1] == 0.0
