"""Means, quantiles, ranks and samples of a mixture agree."""

import numpy as np

from regolithd.calibration.posterior.mixture import PARAMETERS, unpack


def raw_mixture(rows: int = 3, components: int = 4) -> np.ndarray:
    """Return some raw output of a network."""
    return np.random.default_rng(0).normal(0, 0.5, (rows, components * PARAMETERS))


def test_quantiles_means_and_ranks_are_those_of_the_samples() -> None:
    """Means, quantiles and ranks by formula are those of 200 000 joint samples."""
    mixture = unpack(raw_mixture(), np.array([8.0, 0.4, 0.3]), np.array([0.5, 0.1, 0.2]))
    samples = mixture.sample(200_000, np.random.default_rng(1))
    levels = np.array([0.05, 0.5, 0.95])
    np.testing.assert_allclose(mixture.means(), samples.mean(axis=1), rtol=0.02)
    quantiles = mixture.quantiles(levels)
    np.testing.assert_allclose(
        quantiles, np.moveaxis(np.quantile(samples, levels, axis=1), 0, -1), rtol=0.02, atol=0.01
    )
    np.testing.assert_allclose(mixture.ranks(quantiles[:, :, 1]), 0.5, atol=1e-3)


def test_a_single_gaussian_has_its_mean_and_std() -> None:
    """One component with a diagonal whitening matrix has the stated mean and standard deviation of each target."""
    raw = np.array([[0.0, 1.0, -1.0, 0.5, np.log(2.0), 0.0, 0.0, 0.0, 0.0, 0.0]])
    mixture = unpack(raw, np.zeros(3), np.ones(3))
    np.testing.assert_allclose(mixture.weight, [[1.0]])
    np.testing.assert_allclose(mixture.std, [[[0.5, 1.0, 1.0]]])
    np.testing.assert_allclose(mixture.means(), [[np.exp(1.0 + 0.5**2 / 2), -1.0, 0.5]])
