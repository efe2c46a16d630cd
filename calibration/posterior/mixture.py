"""Mixture of Gaussians over cohesion, friction angle and drawbar margin: the output of the posterior network.

NumPy only. The mixture is over the standardised ln c, φ and margin; means, quantiles and samples are in pascals,
radians, and as a share of the load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TARGETS = ("cohesion_Pa", "friction_angle_rad", "drawbar_margin")
"""Quantities of the posterior, in order; the mixture is over the logarithm of the cohesion."""

PARAMETERS = 10
"""Outputs for each component: log weight, three means, lower triangle of a whitening matrix (diagonal as log)."""

_GRID = 401
_HALF_WIDTH = 4.5


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Posteriors of N windows.

    Attributes
    ----------
    weight
        Shape (N, K), adding to 1.
    mean, std
        Shape (N, K, 3): of each component and target, standardised.
    whitening
        Shape (N, K, 3, 3): lower triangular A with A (u − mean) of unit covariance.
    centre, unit
        Shape (3,): mean and standard deviation that standardise the targets.
    """

    weight: Array
    mean: Array
    std: Array
    whitening: Array
    centre: Array
    unit: Array

    def means(self) -> Array:
        """Return the posterior means, shape (N, 3), of the cohesion and not of its logarithm."""
        means = np.sum(self.weight[..., None] * (self.centre + self.unit * self.mean), axis=1)
        spread = (self.unit[0] * self.std[..., 0]) ** 2
        log_mean = self.centre[0] + self.unit[0] * self.mean[..., 0]
        means[:, 0] = np.sum(self.weight * np.exp(log_mean + spread / 2), axis=1)
        return means

    def quantiles(self, levels: Array) -> Array:
        """Return quantiles of each target, shape (N, 3, levels)."""
        answer = np.empty((len(self.weight), 3, len(levels)))
        for target in range(3):
            grid, below = self._distribution(target)
            for row in range(len(grid)):
                answer[row, target] = np.interp(levels, below[row], grid[row])
        return self._physical(answer)

    def ranks(self, truth: Array) -> Array:
        """Return the posterior distribution function at the truth, shape (N, 3): uniform for a calibrated posterior."""
        inner = (self._with_log_cohesion(truth) - self.centre) / self.unit
        answer = np.empty(truth.shape)
        for target in range(3):
            grid, below = self._distribution(target)
            for row in range(len(grid)):
                answer[row, target] = np.interp(inner[row, target], grid[row], below[row])
        return answer

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Return joint samples, shape (N, count, 3)."""
        n, k = self.weight.shape
        chosen = np.array([rng.choice(k, count, p=row) for row in self.weight])
        rows = np.arange(n)[:, None]
        noise = rng.standard_normal((n, count, 3, 1))
        inner = self.mean[rows, chosen] + np.linalg.solve(self.whitening[rows, chosen], noise)[..., 0]
        answer = self.centre + self.unit * inner
        answer[..., 0] = np.exp(answer[..., 0])
        return answer

    def _distribution(self, target: int) -> tuple[Array, Array]:
        """Return a grid and the distribution function on it, each of shape (N, grid), standardised."""
        mean, std = self.mean[..., target], self.std[..., target]
        relevant = self.weight > 1e-4
        low = np.where(relevant, mean - _HALF_WIDTH * std, np.inf).min(axis=1, keepdims=True)
        high = np.where(relevant, mean + _HALF_WIDTH * std, -np.inf).max(axis=1, keepdims=True)
        grid = low + (high - low) * np.linspace(0, 1, _GRID)
        density = np.zeros_like(grid)
        for k in range(mean.shape[1]):
            away = (grid - mean[:, k : k + 1]) / std[:, k : k + 1]
            density += self.weight[:, k : k + 1] / std[:, k : k + 1] * np.exp(-0.5 * away**2)
        below = np.cumsum(density[:, 1:] + density[:, :-1], axis=1)
        return grid, np.concatenate([np.zeros((len(grid), 1)), below / below[:, -1:]], axis=1)

    def _physical(self, values: Array) -> Array:
        shape = (3,) + (1,) * (values.ndim - 2)
        answer = self.centre.reshape(shape) + self.unit.reshape(shape) * values
        answer[:, 0] = np.exp(answer[:, 0])
        return answer

    @staticmethod
    def _with_log_cohesion(truth: Array) -> Array:
        converted = np.array(truth, np.float64)
        converted[:, 0] = np.log(converted[:, 0])
        return converted


def unpack(raw: Array, centre: Array, unit: Array) -> Mixture:
    """Return the mixtures of the network's raw output of shape (N, 10 K)."""
    parts = np.asarray(raw, np.float64).reshape(len(raw), -1, PARAMETERS)
    logit = parts[..., 0] - parts[..., 0].max(axis=1, keepdims=True)
    weight = np.exp(logit) / np.exp(logit).sum(axis=1, keepdims=True)
    whitening = np.zeros((*parts.shape[:2], 3, 3))
    for target in range(3):
        whitening[..., target, target] = np.exp(parts[..., 4 + target])
    whitening[..., 1, 0], whitening[..., 2, 0], whitening[..., 2, 1] = np.moveaxis(parts[..., 7:], -1, 0)
    inverse = np.linalg.inv(whitening)
    std = np.sqrt(np.sum(inverse**2, axis=-1))
    return Mixture(weight, parts[..., 1:4], std, whitening, centre, unit)
