"""The likelihood of a hidden chain is the sum over all sequences of its states."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.intermittency.markov_chain import MarkovChains

READINGS = 7


def densities(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return log densities of the first reading and of the others, of one chain."""
    random = np.random.default_rng(seed)
    return random.normal(size=(1, 2)), random.normal(size=(2, 2, 1, READINGS - 1))


def of_sequence(chain: MarkovChains, states: tuple[int, ...], first: np.ndarray, after: np.ndarray) -> float:
    """Return the likelihood of the readings together with one sequence of states."""
    found = chain.stationary[0, states[0]] * np.exp(first[0, states[0]])
    for k, (before, now) in enumerate(pairwise(states)):
        found *= chain.transitions[0, before, now] * np.exp(after[before, now, 0, k])
    return float(found)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_likelihood_and_probability_are_sums_over_all_sequences(seed: int) -> None:
    """Of seven readings there are 128."""
    chain, (first, after) = MarkovChains(np.array([0.3]), np.array([4.0])), densities(seed)
    sequences = {states: of_sequence(chain, states, first, after) for states in product((0, 1), repeat=READINGS)}
    total = sum(sequences.values())
    np.testing.assert_allclose(chain.log_likelihood(first, after), np.log(total))
    expected = [sum(each for states, each in sequences.items() if states[k]) / total for k in range(READINGS)]
    np.testing.assert_allclose(chain.second_state(first, after), expected)


def test_chains_are_stationary() -> None:
    """The share of the time is what the transitions lead to, and the mean duration what leaving the state makes it."""
    chain = MarkovChains(np.array([0.2, 0.5]), np.array([5.0, 12.0]))
    np.testing.assert_allclose(np.einsum("ci,cij->cj", chain.stationary, chain.transitions), chain.stationary)
    np.testing.assert_allclose(1 / (1 - chain.transitions[:, 1, 1]), chain.duration)


def test_impossible_readings_are_no_underflow() -> None:
    """Thousands of readings far from either level have a finite likelihood."""
    chain = MarkovChains(np.array([0.3]), np.array([4.0]))
    after = np.full((2, 2, 1, 3000), -1e5)
    after[0, 0] = 0.0
    assert np.isfinite(chain.log_likelihood(np.array([[-1e4, 0.0]]), after)).all()
