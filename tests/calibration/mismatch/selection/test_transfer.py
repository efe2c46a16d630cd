"""Cross-validation of single terms on a machine of two axes."""

from __future__ import annotations

import numpy as np
from linear_machine import NOISE, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.cross_validation import (
    drop_what_does_not_transfer,
    gains_on_other_folds,
    other_folds,
    squares_on_fold,
    training_equations,
    transfer_margin,
)


def test_squares_on_a_fold_are_those_of_its_readings() -> None:
    """From the sums of products, without going through time."""
    equations = equations_of(problem_of(table(drag=0.3)))
    fit = equations.fit([term_of(equations, "drag", (1,))])
    residual, design = residual_of(equations, fit), equations.design
    for fold, (a, b) in enumerate(zip(design.cuts[:-1], design.cuts[1:], strict=True)):
        expected = (residual[design.order[a:b]] ** 2).sum(axis=0)
        np.testing.assert_allclose(squares_on_fold(design, fit, fold), expected, rtol=1e-3)


def test_training_folds_and_the_held_out_one_are_disjoint() -> None:
    """Together they are all folds, and a fold alone trains itself."""
    equations = equations_of(problem_of(table()))
    columns = range(equations.design.size)
    for fold in range(5):
        train = training_equations(equations, fold)
        assert fold not in train.folds
        assert {*train.folds, fold} == set(range(5))
        alone = equations.design.products(columns, columns)[fold] * equations.weights[:, None, None]
        together = train.products(columns, columns) + alone
        np.testing.assert_allclose(together, equations.products(columns, columns), rtol=1e-6, atol=1e-3)
    assert other_folds(equations.design, 2) == [0, 1, 3, 4]


def test_a_stationary_effect_comes_back_on_every_fold() -> None:
    """On folds that did not fit it the gain is no less than in sample, but for chance."""
    equations = equations_of(problem_of(table(drag=0.3)))
    terms = [term_of(equations, "drag")]
    gains = gains_on_other_folds(equations, terms, 0)
    assert gains.shape == (5,)
    assert gains.min() > 0
    fit, none = equations.fit(terms), equations.fit(())
    lost = np.sum(residual_of(equations, none) ** 2) - np.sum(residual_of(equations, fit) ** 2)
    assert gains.sum() > 0.95 * lost / NOISE**2
    assert transfer_margin(equations, terms, 0, 8.0) > 0.4 * gains.sum()
    named = equations.fit(terms)
    assert drop_what_does_not_transfer(equations, named, 8.0) is named


def test_an_effect_of_one_run_does_not_transfer() -> None:
    """Of two terms only the one that every run shows stays."""
    columns = table(runs=6, drag=0.3)
    odd = (columns["run"] == 2) * 0.8 * np.abs(columns["speed_rad_s"])
    columns["reading_V"] = columns["reading_V"] + odd
    equations = equations_of(problem_of(columns))
    named = equations.fit([term_of(equations, "power"), term_of(equations, "drag")])
    assert transfer_margin(equations, named.terms, 0, 8.0) < 0
    assert [term.name for term in drop_what_does_not_transfer(equations, named, 8.0).terms] == ["drag"]
