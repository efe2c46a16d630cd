"""Errors of estimates, told from the readings alone, against the truth that made them."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.truths.stein import (
    Estimate,
    best_combination,
    clearly_better,
    consistent,
    squared_error,
)

COUNT = 20_000
RANDOM = np.random.default_rng(6)
TRUTH = RANDOM.normal(0, 1, COUNT)
VARIANCE = 0.5
READINGS = TRUTH + RANDOM.normal(0, VARIANCE**0.5, COUNT)


def shrunk(share: float) -> Estimate:
    """Return readings drawn to 0: a share of 2/3 is the truth's expectation."""
    return Estimate(share * READINGS, np.full(COUNT, share * VARIANCE))


@pytest.mark.parametrize("share", [0.3, 2 / 3, 1.0])
def test_the_error_is_told_without_the_truth(share: float) -> None:
    """Of good estimates and of bad ones."""
    told = squared_error(READINGS, VARIANCE, shrunk(share)).mean()
    assert told == pytest.approx(np.mean((shrunk(share).mean - TRUTH) ** 2), abs=0.02)


def test_a_wrong_shrinkage_is_mended() -> None:
    """The combination of one estimate is the truth's regression on it."""
    combined = best_combination(READINGS, [shrunk(0.3)]).of([shrunk(0.3)])
    np.testing.assert_allclose(combined.mean, 2 / 3 * READINGS, atol=0.05)


def test_an_estimate_that_adds_nothing_has_no_share() -> None:
    """Nor has any a negative one."""
    noise = Estimate(RANDOM.normal(0, 1, COUNT), np.zeros(COUNT))
    shares = best_combination(READINGS, [shrunk(2 / 3), noise]).shares
    assert shares == pytest.approx([1.0, 0.0], abs=0.03)
    assert np.all(shares >= 0)


def test_only_clear_gains_are_gains() -> None:
    """One within chance, one that its fitted numbers make, and one of few readings are none."""
    assert clearly_better(READINGS, VARIANCE, shrunk(2 / 3), shrunk(1.0), fitted=10)
    assert not clearly_better(READINGS, VARIANCE, shrunk(1.0), shrunk(2 / 3), fitted=0)
    assert not clearly_better(READINGS, VARIANCE, shrunk(2 / 3), shrunk(0.66), fitted=0)
    assert not clearly_better(READINGS, VARIANCE, shrunk(2 / 3), shrunk(1.0), fitted=COUNT)
    for count in (99, 100):
        few = [Estimate(each.mean[:count], each.variance[:count]) for each in (shrunk(2 / 3), shrunk(1.0))]
        assert clearly_better(READINGS[:count], VARIANCE, *few, fitted=0) == (count == 100)


def test_an_error_that_is_stated_too_large_shows() -> None:
    """What a model leaves is then less than what it should."""
    assert consistent(READINGS, VARIANCE, shrunk(2 / 3))
    flat = Estimate(np.zeros(COUNT), np.zeros(COUNT))
    noise = READINGS - TRUTH
    assert consistent(noise, VARIANCE, flat)
    assert not consistent(noise, 2 * VARIANCE, flat)
