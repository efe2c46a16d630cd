"""Training examples of the posterior network."""

import numpy as np

from regolithd.calibration.posterior.training_examples import INSTANTS, simulate_examples


def test_examples_have_their_shapes_and_shares() -> None:
    """A thousand windows have at least one wheel each, the stated share of window lengths, and finite features."""
    done: list[int] = []
    examples = simulate_examples(1000, np.random.default_rng(0), done.append)
    assert sum(done) == len(examples.truth) == 1000
    assert examples.windows.mask.any(axis=1).all()
    assert np.isfinite(examples.windows.wheels).all()
    instants = np.round(np.exp(examples.windows.known[:, 5])).astype(int)
    for count, share in INSTANTS.items():
        assert np.mean(instants == count) == share


def test_the_same_seed_gives_the_same_examples() -> None:
    """Examples are determined by the generator's seed."""
    first, second = (simulate_examples(200, np.random.default_rng(4)).windows.wheels for _ in range(2))
    np.testing.assert_array_equal(first, second)
