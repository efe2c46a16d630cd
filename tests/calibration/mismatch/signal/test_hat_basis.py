"""Hat functions: a partition of one on knots within the data."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.hat_basis import hat_functions, hat_functions_at, range_of

VALUES = np.random.default_rng(0).exponential(size=(500, 3))


def test_hats_sum_to_one_where_the_covariate_is_known() -> None:
    """They are 0 where it is unknown or masked."""
    values = VALUES.copy()
    values[::7] = np.nan
    mask = np.ones(values.shape, bool)
    mask[:, 2] = False
    hats = hat_functions(values, mask, 8)
    assert len(hats) == 8
    np.testing.assert_allclose(np.sum(hats, axis=0), (mask & np.isfinite(values)).astype(float), atol=1e-12)
    assert min(hat.min() for hat in hats) >= 0


def test_a_straight_line_is_a_combination_of_hats() -> None:
    """Between the outer knots any piecewise linear function is in the span."""
    low, high = np.quantile(VALUES, [0.005, 0.995])
    inside = np.clip(VALUES, low, high)
    columns = np.stack([hat.ravel() for hat in hat_functions(VALUES, np.ones(VALUES.shape, bool), 6)], axis=1)
    left = inside.ravel() - columns @ np.linalg.lstsq(columns, inside.ravel(), rcond=None)[0]
    assert np.abs(left).max() < 1e-9


def test_knots_are_halfway_between_quantiles_and_an_even_spacing() -> None:
    """Of skewed data the middle knot is left of the middle and right of the median."""
    hats = hat_functions(VALUES, np.ones(VALUES.shape, bool), 3)
    middle = VALUES.ravel()[np.argmax(hats[1])]
    low, high = np.quantile(VALUES, [0.005, 0.995])
    assert middle == pytest.approx(0.5 * (np.median(VALUES) + 0.5 * (low + high)), abs=0.05)


def test_single_extreme_readings_do_not_move_the_knots() -> None:
    """One reading of a thousand times the size changes little."""
    values = VALUES.copy()
    values[0, 0] = 1e6
    mask = np.ones(values.shape, bool)
    one, other = hat_functions(VALUES, mask, 5), hat_functions(values, mask, 5)
    assert max(np.abs(a - b)[1:].max() for a, b in zip(one, other, strict=True)) < 0.1


@pytest.mark.parametrize(
    "values", [np.full((50, 2), 3.0), np.full((50, 2), np.nan), np.repeat([0.0, 1.0], 50).reshape(50, 2)]
)
def test_what_hardly_varies_has_no_hats(values: np.ndarray) -> None:
    """A constant and what was never measured have none, and two values are at most a line."""
    hats = hat_functions(values, np.ones(values.shape, bool), 2)
    assert hats == []


def test_hats_are_straight_lines_between_knots() -> None:
    """As interpolation from 1 at each one's own knot to 0 at the others; beyond the outer knots they are constant."""
    hats = hat_functions(VALUES, np.ones(VALUES.shape, bool), 5)
    inside = VALUES.ravel()
    low, high = np.quantile(inside, [0.005, 0.995])
    knots = 0.5 * (np.quantile(inside, np.linspace(0.005, 0.995, 5)) + np.linspace(low, high, 5))
    for hat, row in zip(hats, np.eye(5), strict=True):
        np.testing.assert_allclose(hat, np.interp(VALUES, knots, row), atol=1e-12)


def test_knots_may_be_given() -> None:
    """Beyond the outermost ones a function is constant."""
    at, known = np.array([0.5, 1.0, 2.0]), np.ones(VALUES.shape, bool)
    hats = hat_functions_at(VALUES, known, at)
    np.testing.assert_allclose(np.tensordot(at, hats, axes=1), np.clip(VALUES, 0.5, 2.0))
    assert range_of(VALUES) == pytest.approx(np.quantile(VALUES, [0.005, 0.995]))
