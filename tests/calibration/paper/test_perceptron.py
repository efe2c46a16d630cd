"""The perceptron's scaling, output and initial weights."""

import numpy as np
import pytest

from regolithd.calibration.paper.perceptron import (
    OUTPUT_UNIT,
    Perceptron,
    mean_squared_error,
    nguyen_widrow,
    scale,
    sigmoid,
    unpack,
)


def test_nguyen_widrow_weights_have_their_length() -> None:
    """Hidden weight vectors are 0.7 ∛H long and biases lie within it."""
    perceptron = unpack(nguyen_widrow(64, np.random.default_rng(0)), 64, np.zeros(3), np.ones(3))
    np.testing.assert_allclose(np.linalg.norm(perceptron.hidden[:, :3], axis=1), 2.8, rtol=1e-6)
    assert np.abs(perceptron.hidden[:, 3]).max() <= 2.8


def test_scaling_brings_the_extremes_to_minus_one_and_one() -> None:
    """The minimum of an input becomes −1, its maximum 1, and the middle 0."""
    low, high = np.array([10.0, 0.0, 0.05]), np.array([90.0, 0.04, 0.1])
    np.testing.assert_allclose(
        scale(np.stack([low, high, (low + high) / 2]), low, high), [[-1] * 3, [1] * 3, [0] * 3], atol=1e-12
    )


def test_sigmoid_is_the_logistic_function() -> None:
    """The sigmoid is 1/(1 + e^(−x)), without overflow far from zero."""
    x = np.array([-1000.0, -2.0, 0.0, 3.0, 1000.0])
    np.testing.assert_allclose(sigmoid(x), [0, 1 / (1 + np.exp(2)), 0.5, 1 / (1 + np.exp(-3)), 1], atol=1e-15)


def test_a_perceptron_without_weights_returns_half_of_each_unit() -> None:
    """With all weights zero both outputs are sigmoid(0): 5 kPa and tan φ = 0.5, whose MSE is zero."""
    perceptron = unpack(np.zeros(6 * 5 + 2, np.float32), 5, np.zeros(3), np.ones(3))
    assert isinstance(perceptron, Perceptron)
    np.testing.assert_allclose(perceptron(np.ones((4, 3))), np.tile([5000.0, 0.5], (4, 1)))
    assert mean_squared_error(perceptron, np.ones((4, 3)), np.tile(OUTPUT_UNIT / 2, (4, 1))) == pytest.approx(0)
