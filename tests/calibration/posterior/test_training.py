"""Training of the posterior network: its loss, and that it decreases."""

import numpy as np
import pytest
from scipy.stats import norm

from regolithd.calibration.posterior.training import fit, negative_log_density
from regolithd.calibration.posterior.training_examples import simulate_examples


def test_the_loss_of_one_gaussian_is_its_negative_log_density() -> None:
    """For one component with unit covariance the loss is that of three independent normal distributions."""
    truth = np.array([[0.3, -0.7, 1.1]])
    raw = np.zeros((1, 10))
    assert float(negative_log_density(raw, truth)) == pytest.approx(-norm.logpdf(truth).sum(), rel=1e-5)


def test_training_decreases_the_loss() -> None:
    """A hundred steps on 1000 windows lower the loss, and the progress is reported every fifty."""
    losses: list[float] = []
    fit(simulate_examples(1000, np.random.default_rng(0)), 0, 100, batch=128, progress=losses.append)
    assert len(losses) == 2
    assert losses[-1] < losses[0]
