"""Closed forms: the right one is among the first three, and none stands on an end of what was searched."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from covariate_sums import sums_with

from regolithd.calibration.mismatch.empirical.grammar import Span, grammar
from regolithd.calibration.mismatch.empirical.suggestions import (
    SUGGESTED,
    best_forms,
    fitted,
    held_out_squares,
    on_an_edge,
    span_of,
    standard_deviations,
)
from regolithd.calibration.mismatch.empirical.sums import profile

if TYPE_CHECKING:
    from collections.abc import Callable

X = np.linspace(-2, 3, 90)
LAWS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "power": lambda x: 0.2 * x**3,
    "saturation": lambda x: np.tanh((x - 0.5) / 0.7),
    "bump": lambda x: np.exp(-(((x - 1) / 0.5) ** 2) / 2),
    "threshold": lambda x: np.maximum(x - 1.2, 0),
    "exponential": lambda x: 0.2 * np.exp(x / 1.2),
    "step": lambda x: 1.0 * (x > 0.8),
    "sine": lambda x: np.cos(5 * x),
}


@pytest.mark.parametrize("family", LAWS)
def test_the_form_of_a_law_is_among_the_first_three(family: str) -> None:
    """Of each family one law, under noise of half its size."""
    sums = sums_with(LAWS[family], X, seed=7)
    assert family in [found.form.family for _, found in best_forms(sums, 1.0)[:SUGGESTED]]


def test_a_straight_line_is_suggested_as_one() -> None:
    """Nothing else has fewer parameters."""
    _, first = best_forms(sums_with(lambda x: 0.4 * x, X, seed=2), 1.0)[0]
    assert (first.form.text, first.constant) == ("c x", False)


def test_parameters_are_within_three_standard_deviations() -> None:
    """Of a bump: size, place and width."""
    sums = sums_with(LAWS["bump"], X, seed=5)
    form = next(form for form in grammar() if form.family == "bump")
    found = fitted(profile(sums), sums.at, form, constant=False)
    truth, values = np.array([1.0, 1.0, 0.5]), np.concatenate((found.coefficients, found.shape))
    assert np.all(np.abs(values - truth) < 3 * standard_deviations(profile(sums), sums.at, found))


def test_the_held_out_error_of_the_right_form_is_the_noise() -> None:
    """To two percent, and that of a wrong one is larger."""
    sums = sums_with(LAWS["bump"], X, seed=5)
    forms = {found.form.family: found for _, found in best_forms(sums, 1.0)}
    errors = {
        name: float(np.sqrt(held_out_squares(sums, forms[name]).sum() / sums.counts.sum())) for name in ("bump", "step")
    }
    assert errors["bump"] == pytest.approx(0.5, rel=0.02)
    assert errors["step"] > 1.02 * errors["bump"]


def test_a_shape_at_an_end_of_its_grid_is_told() -> None:
    """A saturation of a straight line is as wide as may be."""
    sums = sums_with(lambda x: 0.4 * x, X, noise=0.02, seed=2)
    form = next(form for form in grammar() if form.text == "c tanh(x/k)")
    assert on_an_edge(fitted(profile(sums), sums.at, form, constant=False), span_of(sums.at))


def test_forms_that_are_infinite_at_zero_need_a_covariate_that_keeps_away_from_it() -> None:
    """1/x and 1/x² of a height, not of a speed."""
    inverse = [form for form in grammar() if form.text in {"c 1/x", "c 1/x²"}]
    assert len(inverse) == 2
    assert all(form.suits(Span(0.1, 1.0, 0.1)) and not form.suits(Span(-1.0, 1.0, 0.0)) for form in inverse)
