"""The density of true values, from readings with a known error."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.truths.mixing_density import MOST_VALUES, MixingDensity, mixing_density

COUNT = 8000


def test_levels_are_found_behind_an_error_as_large_as_half_their_distance() -> None:
    """Three levels keep their shares, though no reading shows which is its own."""
    random = np.random.default_rng(1)
    truth = random.choice([0.0, 2.0, 6.0], COUNT, p=[0.5, 0.3, 0.2])
    found = mixing_density(truth + random.normal(0, 1, COUNT), 1.0)
    for level, share in ((0.0, 0.5), (2.0, 0.3), (6.0, 0.2)):
        assert found.weight[np.abs(found.at - level) < 1].sum() == pytest.approx(share, abs=0.05)
    assert float(found.weight @ found.at) == pytest.approx(truth.mean(), abs=0.05)
    assert found.weight.sum() == pytest.approx(1)


def test_a_far_outlier_does_not_make_the_grid_large() -> None:
    """Only values that something was read at are on it."""
    readings = np.append(np.random.default_rng(2).normal(0, 1, COUNT), 1e9)
    assert len(mixing_density(readings, 0.1).at) <= MOST_VALUES


def test_readings_that_are_all_the_same_are_one_value() -> None:
    """A range of 0 has one bin."""
    found = mixing_density(np.full(COUNT, 3.0), 0.1)
    np.testing.assert_allclose(found.at, [3.0])
    assert found.effective_count == pytest.approx(1)


def test_exchanging_a_normal_density_for_itself_changes_nothing() -> None:
    """On a fine grid, whatever the posteriors' variances."""
    at = np.linspace(-12, 14, 4001)
    weight = np.exp(-0.5 * ((at - 1) / 2) ** 2)
    density = MixingDensity(at, weight / weight.sum(), np.zeros(len(at)))
    mean, variance = np.array([-1.0, 0.5, 3.0]), np.array([0.2, 1.0, 3.0])
    found, spread = density.reweighted(mean, variance, prior_mean=1.0, prior_variance=4.0)
    np.testing.assert_allclose(found, mean, atol=1e-6)
    np.testing.assert_allclose(spread, variance, rtol=1e-5)


def test_an_atom_at_zero_draws_what_is_near_to_it() -> None:
    """A reading within the error of the atom is that, one far from it is itself."""
    density = MixingDensity(
        np.append(np.linspace(-5, -0.01, 300), np.linspace(0, 5, 301)), np.ones(601) / 1202, np.zeros(601)
    )
    density.weight[300] += 0.5
    found, _ = density.reweighted(np.array([0.02, 3.0]), np.full(2, 0.0025), prior_mean=0.0, prior_variance=1e9)
    np.testing.assert_allclose(found, [0.0, 3.0], atol=1e-2)


def test_an_atom_is_resolved_in_a_range_of_a_thousand_errors() -> None:
    """At rest the error goes; what is read once between there and the far end is itself."""
    random = np.random.default_rng(3)
    truth = np.where(random.uniform(size=COUNT) < 0.7, 0.0, random.uniform(0, 1000, COUNT))
    readings = truth + random.normal(0, 1, COUNT)
    density = mixing_density(readings, 1.0)
    assert len(density.at) <= MOST_VALUES
    found, variance = density.reweighted(readings, np.ones(COUNT), prior_mean=0.0, prior_variance=1e9)
    at_rest, far = truth == 0, truth > 10
    assert np.sqrt(np.mean(found[at_rest] ** 2)) < 0.2
    assert np.sqrt(np.mean((found - truth)[far] ** 2)) == pytest.approx(1.0, abs=0.05)
    assert np.mean(variance) == pytest.approx(np.mean((found - truth) ** 2), rel=0.1)
