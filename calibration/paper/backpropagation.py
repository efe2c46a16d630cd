"""Backpropagation with momentum and an adaptive learning rate (Sec. 2.4), compiled with numba.

The rules are those of MATLAB's `traingdx` with its defaults:

- full batch: each epoch uses all pairs;
- step = 0.9 × last step − 0.1 × rate × gradient;
- a step that increases the MSE by more than 4 % is rejected, the rate is multiplied by 0.7, and the last step is reset;
- a step that decreases the MSE is accepted and the rate multiplied by 1.05;
- training ends at the goal or after the last epoch.

An epoch takes about 20 µs on one core: the activations of one network (64 × 504 float32) stay in the core's cache, and
no array operation allocates memory between the loops. Networks are independent and are trained in parallel threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.paper.perceptron import OUTPUT_UNIT, OUTPUTS, Perceptron, nguyen_widrow, scale, unpack

if TYPE_CHECKING:
    from regolithd.calibration.paper.training_set import TrainingSet

Single = NDArray[np.float32]

GOAL_MSE = 0.005
EPOCHS = 10_000

_ZERO, _HALF, _ONE, _SATURATION = np.float32(0), np.float32(0.5), np.float32(1), np.float32(8)
_MOMENTUM, _INITIAL_RATE, _RATE_INCREASE, _RATE_DECREASE, _MAX_ERROR_RATIO = (
    np.float32(x) for x in (0.9, 0.01, 1.05, 0.7, 1.04)
)
# tanh y ≈ y P(y²)/Q(y²), error below 2·10⁻⁷ for |y| ≤ 8 (minimax fit): unlike a call of the library's tanh, additions
# and multiplications are vectorised by the compiler.
_P0, _P1, _P2, _P3, _P4 = (
    np.float32(x) for x in (9.99999065e-01, 1.26997812e-01, 2.68449466e-03, 7.08344560e-06, -6.01998644e-09)
)
_Q1, _Q2, _Q3 = (np.float32(x) for x in (4.60327739e-01, 2.27973880e-02, 1.95299005e-04))

_compile = numba.njit(fastmath=True, error_model="numpy", nogil=True, cache=True)
_inline = numba.njit(fastmath=True, error_model="numpy", nogil=True, cache=True, inline="always")


@_inline
def _sigmoid(x: np.float32) -> np.float32:
    y = min(max(_HALF * x, -_SATURATION), _SATURATION)
    u = y * y
    numerator = _P0 + u * (_P1 + u * (_P2 + u * (_P3 + u * _P4)))
    return _HALF + _HALF * y * numerator / (_ONE + u * (_Q1 + u * (_Q2 + u * _Q3)))


@_compile
def _forward(
    inputs: Single, targets: Single, weights: Single, neurons: int, hidden: Single, delta: Single
) -> np.float32:
    """Return the MSE; leave activations in `hidden` (H, pairs) and ∂MSE/∂net of the outputs in `delta` (2, pairs)."""
    pairs = inputs.shape[1]
    outward, shift = weights[4 * neurons : 6 * neurons], weights[6 * neurons :]
    for n in range(pairs):
        delta[0, n] = shift[0]
        delta[1, n] = shift[1]
    for h in range(neurons):
        w0, w1, w2 = weights[3 * h], weights[3 * h + 1], weights[3 * h + 2]
        bias, v0, v1 = weights[3 * neurons + h], outward[h], outward[neurons + h]
        for n in range(pairs):
            a = _sigmoid(w0 * inputs[0, n] + w1 * inputs[1, n] + w2 * inputs[2, n] + bias)
            hidden[h, n] = a
            delta[0, n] += v0 * a
            delta[1, n] += v1 * a
    total = _ZERO
    for k in range(OUTPUTS):
        for n in range(pairs):
            out = _sigmoid(delta[k, n])
            error = out - targets[k, n]
            total += error * error
            delta[k, n] = error * (out * (_ONE - out))
    return total / np.float32(OUTPUTS * pairs)


@_compile
def _backward(inputs: Single, weights: Single, neurons: int, hidden: Single, delta: Single, gradient: Single) -> None:
    """Write ∂MSE/∂weights into `gradient`, in the order of the weights."""
    pairs = inputs.shape[1]
    share = np.float32(2) / np.float32(OUTPUTS * pairs)
    for h in range(neurons):
        v0, v1 = weights[4 * neurons + h], weights[5 * neurons + h]
        s0 = s1 = s2 = bias = u0 = u1 = _ZERO
        for n in range(pairs):
            a, d0, d1 = hidden[h, n], delta[0, n], delta[1, n]
            d = (d0 * v0 + d1 * v1) * (a * (_ONE - a))
            s0 += d * inputs[0, n]
            s1 += d * inputs[1, n]
            s2 += d * inputs[2, n]
            bias += d
            u0 += d0 * a
            u1 += d1 * a
        gradient[3 * h], gradient[3 * h + 1], gradient[3 * h + 2] = share * s0, share * s1, share * s2
        gradient[3 * neurons + h] = share * bias
        gradient[4 * neurons + h], gradient[5 * neurons + h] = share * u0, share * u1
    for k in range(OUTPUTS):
        gradient[6 * neurons + k] = share * delta[k].sum()


@_compile
def _train(
    inputs: Single, targets: Single, weights: Single, neurons: int, epochs: int, goal: float
) -> tuple[float, int]:
    """Train `weights` in place; return the MSE that is reached and the number of epochs."""
    hidden = np.empty((neurons, inputs.shape[1]), np.float32)
    delta = np.empty((OUTPUTS, inputs.shape[1]), np.float32)
    gradient, step, trial = np.empty_like(weights), np.zeros_like(weights), np.empty_like(weights)
    rate = _INITIAL_RATE
    error = _forward(inputs, targets, weights, neurons, hidden, delta)
    _backward(inputs, weights, neurons, hidden, delta, gradient)
    epoch = 0
    while epoch < epochs and error > goal:
        epoch += 1
        for k in range(weights.size):
            step[k] = _MOMENTUM * step[k] - (_ONE - _MOMENTUM) * rate * gradient[k]
            trial[k] = weights[k] + step[k]
        tried = _forward(inputs, targets, trial, neurons, hidden, delta)
        if tried > _MAX_ERROR_RATIO * error:
            rate *= _RATE_DECREASE
            step[:] = _ZERO
            continue
        if tried < error:
            rate *= _RATE_INCREASE
        error = tried
        weights[:] = trial
        _backward(inputs, weights, neurons, hidden, delta, gradient)
    return float(error), epoch


@dataclass(frozen=True, slots=True, eq=False)
class Training:
    """Result of one training: the perceptron, its MSE, and the epochs that were run."""

    perceptron: Perceptron
    mse: float
    epochs: int


def train(
    pairs: TrainingSet, neurons: int, rng: np.random.Generator, epochs: int = EPOCHS, goal: float = GOAL_MSE
) -> Training:
    """Train one perceptron from new initial weights; the global interpreter lock is released meanwhile."""
    low, high = pairs.inputs.min(axis=0), pairs.inputs.max(axis=0)
    inputs = np.ascontiguousarray(scale(pairs.inputs, low, high).T, np.float32)
    targets = np.ascontiguousarray((pairs.outputs / OUTPUT_UNIT).T, np.float32)
    weights = nguyen_widrow(neurons, rng)
    mse, taken = _train(inputs, targets, weights, neurons, epochs, goal)
    return Training(unpack(weights, neurons, low, high), mse, taken)
