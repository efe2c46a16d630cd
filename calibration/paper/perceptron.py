"""The paper's multilayer perceptron 3:H:2 with logistic sigmoids (Secs 2.2, 2.3), its scaling and its initial weights.

The paper does not specify the following; chosen here:

- Inputs are scaled to [−1, 1] by their minimum and maximum, which the rule of Nguyen and Widrow assumes.
- Outputs are c in 10 kPa and tan φ. Both are within (0, 1), the range of the sigmoid, and of the scalings tried it is
  the only one in which the paper's MSE of 0.0251 can be reached (`docs/results/reproduction.md` lists the others).
- The output layer has sigmoids too; its initial weights are uniform in [−0.5, 0.5].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Weights = NDArray[np.float32]

INPUTS = 3
OUTPUTS = 2
OUTPUT_UNIT = np.array([10_000.0, 1.0])
"""The outputs' scale: an output of 1 is a cohesion of 10 kPa, or a tan φ of 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Perceptron:
    """A trained perceptron.

    Attributes
    ----------
    hidden
        Shape (H, 4): weights of the three scaled inputs, then the bias.
    output
        Shape (2, H + 1): weights of the hidden neurons, then the bias.
    low, high
        Shape (3,): minimum and maximum of each input in the training set, scaled to −1 and 1.
    """

    hidden: Array
    output: Array
    low: Array
    high: Array

    def __call__(self, inputs: Array) -> Array:
        """Return cohesion [Pa] and tan φ [1], shape (N, 2), for load [N], slip, motor current [A], shape (N, 3)."""
        scaled = scale(inputs, self.low, self.high)
        hidden = sigmoid(scaled @ self.hidden[:, :INPUTS].T + self.hidden[:, INPUTS])
        return OUTPUT_UNIT * sigmoid(hidden @ self.output[:, :-1].T + self.output[:, -1])


def sigmoid(x: Array) -> Array:
    """Return the logistic sigmoid 1/(1 + e^(−x))."""
    return 0.5 * (1 + np.tanh(0.5 * x))


def scale(inputs: Array, low: Array, high: Array) -> Array:
    """Return the inputs scaled so that [low, high] becomes [−1, 1]."""
    return 2 * (np.asarray(inputs, np.float64) - low) / (high - low) - 1


def mean_squared_error(perceptron: Perceptron, inputs: Array, outputs: Array) -> float:
    """Return the MSE over pairs and outputs, in units of `OUTPUT_UNIT` (10 kPa, 1)."""
    return float(np.mean(((perceptron(inputs) - outputs) / OUTPUT_UNIT) ** 2))


def nguyen_widrow(neurons: int, rng: np.random.Generator) -> Weights:
    """Return initial weights by the rule of Nguyen and Widrow (1990), as a flat vector in the order of `unpack`.

    Hidden weight vectors have random directions and the length β = 0.7 H^(1/3); biases are uniform in [−β, β].
    """
    length = 0.7 * neurons ** (1 / INPUTS)
    direction = rng.uniform(-0.5, 0.5, (neurons, INPUTS))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    bias = rng.uniform(-length, length, neurons)
    output = rng.uniform(-0.5, 0.5, OUTPUTS * neurons + OUTPUTS)
    return np.concatenate([(length * direction).ravel(), bias, output]).astype(np.float32)


def unpack(weights: Weights, neurons: int, low: Array, high: Array) -> Perceptron:
    """Return the perceptron of a flat vector: hidden weights (H, 3), biases, output weights (2, H), biases."""
    flat = np.asarray(weights, np.float64)
    inward, bias, outward, shift = np.split(flat, np.cumsum([3 * neurons, neurons, 2 * neurons]))
    hidden = np.column_stack([inward.reshape(neurons, INPUTS), bias])
    return Perceptron(hidden, np.column_stack([outward.reshape(OUTPUTS, neurons), shift]), low, high)
