"""Least squares from products alone."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.least_squares import fitted, squares_left


def test_products_tell_the_coefficients_and_what_is_left() -> None:
    """As the columns themselves do."""
    rng = np.random.default_rng(1)
    columns, residual = rng.normal(size=(3, 50)) * np.array([[1e-6], [1.0], [1e6]]), rng.normal(size=50)
    expected, left, *_ = np.linalg.lstsq(columns.T, residual, rcond=None)
    every = np.vstack((columns, residual))
    squares, last = squares_left(every @ every.T)
    assert squares == pytest.approx(left[0])
    assert last == pytest.approx(expected[-1])
    assert fitted(columns @ columns.T, columns @ residual) == pytest.approx(expected)


def test_a_column_of_zeros_and_one_that_is_there_twice_are_no_fault() -> None:
    """The first has no coefficient; of the others each has a half."""
    column = np.array([1.0, 2.0, 3.0])
    every = np.stack((column, 0 * column, column, 4 * column))
    products = every @ every.T
    assert fitted(products[:-1, :-1], products[:-1, -1]) == pytest.approx([2.0, 0.0, 2.0])
    assert squares_left(products)[0] == pytest.approx(0.0, abs=1e-9)


def test_without_columns_all_is_left() -> None:
    """And there is no last coefficient."""
    assert squares_left(np.array([[7.0]])) == (7.0, 0.0)
