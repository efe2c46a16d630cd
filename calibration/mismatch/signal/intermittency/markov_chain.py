"""Likelihood of readings whose density depends on a hidden state of two, and on the state before it.

The states are a stationary Markov chain. The sum over all sequences of states is a product of matrices (Baum et al.,
1970), which is computed in pairs, of many chains at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMALLEST_LOG = -200.0
"""Logarithm of the smallest density over the largest one at a reading: two of them are still no underflow."""


@dataclass(frozen=True, eq=False)
class MarkovChains:
    """Chains of two states, of which the second has a share of the time and a mean duration, shape (chain,) each."""

    share: Array
    duration: Array

    @property
    def leaving(self) -> tuple[Array, Array]:
        """Probabilities of leaving the first and the second state from one reading to the next."""
        return self.share / (1 - self.share) / self.duration, 1 / self.duration

    @property
    def memory(self) -> Array:
        """Correlation of the state with the one before it."""
        begins, ends = self.leaving
        return 1 - begins - ends

    @property
    def stationary(self) -> Array:
        """Probability of each state, shape (chain, state)."""
        return np.stack((1 - self.share, self.share), axis=-1)

    @property
    def transitions(self) -> Array:
        """Probability of each state after each, shape (chain, before, state)."""
        begins, ends = self.leaving
        return np.stack((1 - begins, begins, ends, 1 - ends), axis=-1).reshape(-1, 2, 2)

    def log_likelihood(self, first: Array, after: Array) -> Array:
        """Return the logarithm of the likelihood, shape (chain,).

        Parameters
        ----------
        first: log density of the first reading in each state, shape (chain, state)
        after: log density of each reading after it, given the state before and its own, (before, state, chain, time)
        """
        largest = _largest(after)
        total = largest.sum(axis=-1)
        # Numbers of one place in all matrices are neighbours in memory: a product of matrices of two by two is slow.
        product = np.exp(np.maximum(after - largest, SMALLEST_LOG)) * self.transitions.transpose(1, 2, 0)[..., None]
        while product.shape[-1] > 1:
            even = product.shape[-1] // 2 * 2
            one, other = product[..., 0:even:2], product[..., 1:even:2]
            pairs = one[:, 0, None] * other[0] + one[:, 1, None] * other[1]
            size = _largest(pairs)
            total += np.log(size).sum(axis=-1)
            product = np.concatenate((pairs / size, product[..., even:]), axis=-1)
        top = first.max(axis=-1)
        begins = self.stationary * np.exp(first - top[:, None])
        return np.asarray(total + top + np.log(np.einsum("ci,ijc->c", begins, product[..., 0])))

    def second_state(self, first: Array, after: Array) -> Array:
        """Return the probability that the first chain is in its second state at each reading, given all, (time,)."""
        of_first = after[:, :, 0]
        steps = np.exp(of_first - _largest(of_first)).transpose(2, 0, 1) * self.transitions[0]
        forward = np.empty((len(steps) + 1, 2))
        forward[0] = self.stationary[0] * np.exp(first[0] - first[0].max())
        for k, step in enumerate(steps):
            now = forward[k] @ step
            forward[k + 1] = now / now.sum()
        backward = np.ones((len(steps) + 1, 2))
        for k in range(len(steps) - 1, -1, -1):
            before = steps[k] @ backward[k + 1]
            backward[k] = before / before.sum()
        both = forward * backward
        return np.asarray(both[:, 1] / both.sum(axis=1))


def _largest(matrices: Array) -> Array:
    """Return the largest number of each matrix, shape (…,), of matrices of shape (before, state, …)."""
    return np.asarray(np.maximum.reduce(matrices.reshape(-1, *matrices.shape[2:])))
