"""Sums in bins of a covariate stand for the readings themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.empirical.sums import profile, squares_on_fold, sums_of
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.cross_validation import squares_on_fold as squares_of_readings
from regolithd.calibration.mismatch.selection.cross_validation import training_equations
from regolithd.calibration.mismatch.selection.noise_estimation import whitened
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


@pytest.fixture(scope="module")
def equations() -> NormalEquations:
    """Return equations of a recording with a drag and a bump over the speed."""
    columns = table(drag=0.4)
    bump = 0.6 * np.exp(-(((np.abs(columns["speed_rad_s"]) - 0.9) / 0.2) ** 2))
    made = equations_of(problem_of({**columns, "reading_V": columns["reading_V"] + bump}))
    return made.over(with_smooth_terms(made.design))


def test_a_curve_gains_in_bins_what_it_gains_in_readings(equations: NormalEquations) -> None:
    """The smooth term of the engine, as values in the bins beside a named drag, has the engine's Δχ² to a hundredth."""
    named = equations.fit([term_of(equations, "drag")])
    curves = [term for _, term in best_of_each_smooth_term(equations, named.terms)]
    curve = next(term for term in curves if term.name == "wheel_speed" and term.group.coupling == "offset")
    whole = equations.fit((*named.terms, curve))
    sums = sums_of(equations, named, curve, named)
    of = profile(sums)
    speed, mask = np.abs(equations.problem.covariates["wheel_speed"]), equations.problem.mask
    hats = hat_functions(speed, mask, equations.thresholds.curve_knots)
    on = list(curve.wheels)
    scale = equations.design.scale[list(curve.group.columns)]
    coefficients = whole.coefficients[whole.of_term(1)] / scale
    order = np.argsort(speed[:, on], axis=None)
    told = sum(c * hat[:, on].ravel()[order] for c, hat in zip(coefficients, hats, strict=True))
    values = np.interp(sums.at, speed[:, on].ravel()[order], told)
    gained = 2 * values @ of.moment - values @ of.matrix @ values
    assert gained == pytest.approx(whole.delta_chi2 - named.delta_chi2, rel=0.01)


def test_the_noise_of_a_curve_is_what_the_fit_with_it_leaves(equations: NormalEquations) -> None:
    """Where its course were taken for noise, that would have a long memory, and the curve be smoothed away."""
    named = equations.fit([term_of(equations, "drag")])
    curves = [term for _, term in best_of_each_smooth_term(equations, named.terms)]
    curve = next(term for term in curves if term.name == "wheel_speed" and term.group.coupling == "offset")
    white = whitened(equations, residual_of(equations, equations.fit((*named.terms, curve))))
    fits = white.fit((*named.terms, curve)), white.fit(named.terms)
    with_it, without = (sums_of(white, fits[1], curve, fit) for fit in fits)
    assert np.all(with_it.weights > 2 * without.weights)
    assert (with_it.energy == without.energy).all()


def test_without_a_curve_the_held_out_squares_are_those_of_the_readings(equations: NormalEquations) -> None:
    """On each fold, fitted on the others, beside a named drag."""
    named = equations.fit([term_of(equations, "drag")])
    curve = best_of_each_smooth_term(equations, named.terms)[0][1]
    sums = sums_of(equations, named, curve, equations.fit((*named.terms, curve)))
    nothing = np.zeros(len(sums.at))
    for fold in sums.folds:
        train = training_equations(equations, fold)
        expected = squares_of_readings(train.design, train.fit(named.terms), fold)
        found = squares_on_fold(sums, fold, nothing, profile(sums, sums.other_folds(fold)).others(nothing))
        assert found == pytest.approx(expected, rel=1e-5)  # both are sums in single precision


def test_a_column_that_is_zero_on_a_curve_s_wheels_has_no_coefficient(equations: NormalEquations) -> None:
    """A ripple of one wheel has columns for the others too: beside a curve they were a division by next to nothing."""
    named = equations.fit([term_of(equations, "drag"), term_of(equations, "offset")])
    curve = best_of_each_smooth_term(equations, named.terms)[0][1]
    sums = sums_of(equations, named, curve, equations.fit((*named.terms, curve)))
    for values in (sums.cross, sums.gram, sums.column_moment):
        values[..., -1] = 0.0
    sums.gram[..., -1, :] = 0.0
    of = profile(sums)
    assert np.isfinite(of.matrix).all()
    assert of.others(np.zeros(len(sums.at)))[-1] == 0.0
