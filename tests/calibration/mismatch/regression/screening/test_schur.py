"""Schur complements: what explicit regressions say of columns beside others."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.regression.screening.schur import (
    delta_chi2_of_each,
    delta_chi2_together,
    explained_part,
    pseudo_inverse,
    schur_complement,
    schur_diagonal,
    with_further_readings,
)

RNG = np.random.default_rng(0)
FITTED, NEW = RNG.normal(size=(200, 4)), RNG.normal(size=(200, 3))
READING = RNG.normal(size=200) + NEW @ [0.3, -0.2, 0.1]
INVERSE = np.linalg.inv(FITTED.T @ FITTED)
CROSS, OWN = FITTED.T @ NEW, NEW.T @ NEW


def squares_left(columns: np.ndarray) -> float:
    """Return the sum of squares that a regression leaves."""
    left = READING - columns @ np.linalg.lstsq(columns, READING, rcond=None)[0]
    return float(left @ left)


def moment() -> np.ndarray:
    """Return the new columns' products with what the fitted ones leave."""
    return NEW.T @ (READING - FITTED @ INVERSE @ FITTED.T @ READING)


def test_the_complement_is_the_energy_of_residualised_columns() -> None:
    """Frisch, Waugh and Lovell: regress the new columns on the fitted ones first."""
    outside = NEW - FITTED @ INVERSE @ CROSS
    np.testing.assert_allclose(schur_complement(OWN, CROSS, INVERSE), outside.T @ outside)
    np.testing.assert_allclose(explained_part(CROSS, INVERSE) + outside.T @ outside, OWN)
    np.testing.assert_allclose(schur_diagonal(np.diag(OWN), CROSS, INVERSE), np.diag(outside.T @ outside))


def test_delta_chi2_is_the_difference_of_residual_sums() -> None:
    """Of each column by itself, and of all together."""
    complement = schur_complement(OWN, CROSS, INVERSE)
    before = squares_left(FITTED)
    each = delta_chi2_of_each(moment(), np.diag(complement), np.diag(OWN), np.zeros(3), 1e-3)
    for place, gain in enumerate(each):
        assert gain == pytest.approx(before - squares_left(np.column_stack((FITTED, NEW[:, place]))))
    together = delta_chi2_together(moment(), complement, float(np.diag(OWN).max()), (0, 0, 0), 1e-3)
    assert together == pytest.approx(before - squares_left(np.column_stack((FITTED, NEW))))


def test_a_coefficient_of_the_wrong_sign_gains_nothing() -> None:
    """One wrong sign among several suffices."""
    complement = schur_complement(OWN, CROSS, INVERSE)
    energy = float(np.diag(OWN).max())
    signs = np.sign(np.linalg.solve(complement, moment()))
    right = delta_chi2_together(moment(), complement, energy, [int(s) for s in signs], 1e-3)
    assert right > 0
    for place in range(3):
        wrong = [int(-s if place == k else s) for k, s in enumerate(signs)]
        assert delta_chi2_together(moment(), complement, energy, wrong, 1e-3) == 0
    each = delta_chi2_of_each(moment(), np.diag(complement), np.diag(OWN), -np.sign(moment()), 1e-3)
    np.testing.assert_array_equal(each, 0)


def test_a_combination_of_fitted_columns_gains_nothing() -> None:
    """Its complement is rounding, and nothing is divided by it."""
    same = FITTED @ [1.0, -2.0, 0.5, 0.0]
    cross, own = FITTED.T @ same[:, None], np.array([[same @ same]])
    complement = schur_complement(own, cross, INVERSE)
    left = np.array([same @ READING - cross[:, 0] @ INVERSE @ FITTED.T @ READING])
    assert delta_chi2_of_each(left, np.diag(complement), np.diag(own), np.zeros(1), 1e-3)[0] == 0
    assert delta_chi2_together(left, complement, float(own[0, 0]), (0,), 1e-3) == 0


def test_many_draws_of_moments_are_judged_at_once() -> None:
    """The shape (draw, column) is kept."""
    draws = RNG.normal(size=(5, 3))
    found = delta_chi2_of_each(draws, np.ones(3), np.ones(3), np.array([1, 0, -1]), 1e-3)
    np.testing.assert_allclose(found[:, 1], draws[:, 1] ** 2)
    np.testing.assert_allclose(found[:, 0], np.where(draws[:, 0] >= 0, draws[:, 0] ** 2, 0))
    np.testing.assert_allclose(found[:, 2], np.where(draws[:, 2] <= 0, draws[:, 2] ** 2, 0))


def test_a_pseudo_inverse_does_not_depend_on_units() -> None:
    """Columns of any size, and a prior of any precision beside them, are inverted as they are in units of their own."""
    matrix, units = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([1e-9, 1e6])
    found = pseudo_inverse(matrix * np.outer(units, units), 1e-10)
    np.testing.assert_allclose(found * np.outer(units, units), np.linalg.inv(matrix), rtol=1e-9)
    undetermined = pseudo_inverse(np.ones((2, 2)), 1e-10) @ np.array([1.0, -1.0])
    np.testing.assert_allclose(undetermined, 0.0, atol=1e-12)


def test_rounding_below_zero_is_no_direction() -> None:
    """The energy of a combination of columns that is nearly 0 may come out below 0: it has no part in the solution."""
    along = np.array([1.0, 1.0]) / np.sqrt(2)
    across = np.array([1.0, -1.0]) / np.sqrt(2)
    matrix = 1e8 * np.outer(along, along) - 3.0 * np.outer(across, across)
    inverse = pseudo_inverse(matrix, 1e-10)
    assert np.linalg.eigvalsh(inverse).min() > -1e-20
    assert along @ inverse @ along == pytest.approx(1e-8)


def test_further_readings_of_some_columns_are_those_of_their_span() -> None:
    """Least squares of the readings, and of three further copies of each column's part in the span of some."""
    columns, some = np.column_stack((FITTED, NEW)), [4, 5]
    span = np.linalg.qr(columns[:, some])[0]
    within = span @ span.T
    again = np.concatenate([columns, *[within @ columns] * 3])
    read = np.concatenate([READING, *[within @ READING] * 3])
    reductions = np.where(np.isin(np.arange(7), some), 4.0, 1.0)
    gram, along = with_further_readings(columns.T @ columns, columns.T @ READING, reductions, 1e-12)
    np.testing.assert_allclose(gram, again.T @ again)
    np.testing.assert_allclose(along, again.T @ read)


def test_where_no_column_knows_more_the_sums_stay() -> None:
    """Also where one that would is 0 here."""
    gram, of_new = OWN.copy(), moment()
    gram[0], gram[:, 0] = 0.0, 0.0
    found = with_further_readings(gram, of_new, np.array([9.0, 1.0, 1.0]), 1e-12)
    assert found[0] is gram
    assert found[1] is of_new
