"""Means in bins."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.signal.binning import binned_means, even_edges


def test_bins_hold_equal_numbers_and_their_means() -> None:
    """The mean of a line over a bin is the line at the bin's mean."""
    values = np.random.default_rng(0).exponential(size=2400)
    binned = binned_means(values, even_edges(values, 24), 3 * values + 1, -values)
    assert len(binned.at) == 24
    assert set(binned.count) == {100}
    np.testing.assert_allclose(binned.means[0], 3 * binned.at + 1)
    np.testing.assert_allclose(binned.means[1], -binned.at)


def test_what_is_beyond_the_edges_is_in_the_outer_bins() -> None:
    """No value is lost, and a bin without a value is left out."""
    binned = binned_means(np.array([-5.0, 0.5, 9.0]), np.array([0.0, 1.0, 2.0, 3.0]), np.ones(3))
    np.testing.assert_array_equal(binned.count, [2, 1])
    np.testing.assert_allclose(binned.at, [-2.25, 9.0])
    np.testing.assert_allclose(binned.means[0], [1.0, 1.0])


def test_edges_of_few_values_are_few() -> None:
    """Two distinct values have one bin."""
    assert len(even_edges(np.repeat([1.0, 2.0], 50), 10)) <= 3
