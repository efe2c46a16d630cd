"""The paper's multilayer perceptron 3:H:2 with binary sigmoids (Secs 2.2, 2.3), its scaling and its initial weights.

What the paper does not say, and what is taken here:

- Inputs are brought to [−1, 1] by their extremes, which is what Nguyen and Widrow's rule asks for.
- Outputs are c in 10 kPa and tan φ, unscaled. Both lie inside a binary sigmoid's range (0, 1), and it is the scaling in
  which the paper's MSE of 0.0251 can be reached at all (`docs/reproduction.md` shows the others).
- The output layer has binary sigmoids too, and starts from weights in [−0.5, 0.5].
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
"""What one unit of the network's outputs is: 10 kPa of cohesion, 1 of tan φ."""


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A trained network.

    Attributes
    ----------
    hidden
        Shape (H, 4): weights of the three scaled inputs, then the bias.
    output
        Shape (2, H + 1): weights of the hidden neurons, then the bias.
    low, high
        Shape (3,): the inputs' extremes in the training set, which are scaled to −1 and 1.
    """

    hidden: Array
    output: Array
    low: Array
    high: Array

    def __call__(self, inputs: Array) -> Array:
        """Return cohesion [Pa] and tan φ, shape (N, 2), for load [N], slip and motor current [A], shape (N, 3)."""
        scaled = scale(inputs, self.low, self.high)
        hidden = sigmoid(scaled @ self.hidden[:, :INPUTS].T + self.hidden[:, INPUTS])
        return OUTPUT_UNIT * sigmoid(hidden @ self.output[:, :-1].T + self.output[:, -1])


def sigmoid(x: Array) -> Array:
    """Return the binary sigmoid 1/(1 + e^(−x))."""
    return 0.5 * (1 + np.tanh(0.5 * x))


def scale(inputs: Array, low: Array, high: Array) -> Array:
    """Return the inputs with [low, high] brought to [−1, 1]."""
    return 2 * (np.asarray(inputs, np.float64) - low) / (high - low) - 1


def mean_squared_error(network: Network, inputs: Array, outputs: Array) -> float:
    """Return the MSE over pairs and outputs in the network's own units (10 kPa, 1), as the paper's goal means it."""
    return float(np.mean(((network(inputs) - outputs) / OUTPUT_UNIT) ** 2))


def nguyen_widrow(neurons: int, rng: np.random.Generator) -> Weights:
    """Return initial weights after Nguyen and Widrow, flat, in the order of `unpack`.

    Hidden weight vectors point anywhere and have the length β = 0.7 H^(1/3); biases are uniform in [−β, β].
    """
    length = 0.7 * neurons ** (1 / INPUTS)
    direction = rng.uniform(-0.5, 0.5, (neurons, INPUTS))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    bias = rng.uniform(-length, length, neurons)
    output = rng.uniform(-0.5, 0.5, OUTPUTS * neurons + OUTPUTS)
    return np.concatenate([(length * direction).ravel(), bias, output]).astype(np.float32)


def unpack(weights: Weights, neurons: int, low: Array, high: Array) -> Network:
    """Return the network of a flat vector: hidden weights (H, 3) and biases, output weights (2, H) and biases."""
    flat = np.asarray(weights, np.float64)
    inward, bias, outward, shift = np.split(flat, np.cumsum([3 * neurons, neurons, 2 * neurons]))
    hidden = np.column_stack([inward.reshape(neurons, INPUTS), bias])
    return Network(hidden, np.column_stack([outward.reshape(OUTPUTS, neurons), shift]), low, high)
