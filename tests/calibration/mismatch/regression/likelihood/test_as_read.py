"""Whitened equations, and a fit to the readings as they were read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import equations_of, problem_of, table, term_of
from scipy.signal import lfilter

from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read, long_run_weights
from regolithd.calibration.mismatch.regression.residuals import chi2_of, contribution, residual_of
from regolithd.calibration.mismatch.selection.noise_estimation import whitened
from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

    Array = NDArray[np.float64]

KEEPS = 0.9


def equations_under_slow_noise(seed: int, drag: float, *, blank: bool = False) -> NormalEquations:
    """Return whitened equations of a recording under noise with a memory; half of the first axis may be blank."""
    columns = table(noise=0.0, drag=drag)
    fresh = np.random.default_rng(seed).standard_normal((900, 2))
    slow = lfilter([np.sqrt(1 - KEEPS**2)], [1, -KEEPS], fresh, axis=0)[100:]
    columns["reading_V"] = columns["reading_V"] + 0.2 * slow.ravel()
    if blank:
        columns["reading_V"][200:600:2] = np.nan
    equations = equations_of(problem_of(columns))
    return whitened(equations, residual_of(equations, equations.fit([term_of(equations, "drag")])))


@pytest.mark.parametrize("blank", [False, True])
def test_columns_and_residual_are_restored(blank: bool) -> None:
    """Of whitened equations the readings come back; a fit's residual and contributions are in the channel's unit."""
    white = equations_under_slow_noise(1, 0.3, blank=blank)
    plain = white.whitened(NOT_WHITENED, white.weights)
    assert len(white.design.whitening.coefficients) > 0
    at = range(white.design.size)
    np.testing.assert_array_equal(white.design.columns_as_read(at), plain.design.columns(at))
    np.testing.assert_array_equal(white.design.whitened(plain.design.columns(at)), white.design.columns(at))
    problem = white.problem
    expected = np.where(problem.mask, problem.measured - problem.filled, 0.0)
    fit = white.fit([term_of(white, "drag")])
    column = white.design.in_time(white.design.columns_as_read([0])[0].astype(np.float64))
    rest = expected - fit.coefficients[0] * column - contribution(white, fit, 0)
    np.testing.assert_allclose(residual_of(white, fit), np.where(problem.mask, rest, 0.0), atol=1e-4)


def test_a_gain_is_what_the_weighted_squares_lose() -> None:
    """Δχ² of whitened equations is the difference of the weighted sums of squares, the prior's part apart."""
    white = equations_under_slow_noise(2, 0.3)
    without, with_it = white.fit(()), white.fit([term_of(white, "drag")])
    pulls = [white.nuisance.prior_stds_away(fit) @ white.nuisance.prior_stds_away(fit) for fit in (without, with_it)]
    lost = chi2_of(white, without).sum() + pulls[0] - chi2_of(white, with_it).sum() - pulls[1]
    assert with_it.delta_chi2 == pytest.approx(lost, rel=1e-3)


def test_what_changes_quickly_has_more_evidence_than_as_read() -> None:
    """A drag that changes its sign under noise that changes slowly."""
    gains, as_they_are = [], []
    for seed in range(8):
        white = equations_under_slow_noise(seed, 0.1)
        gains.append(white.fit([term_of(white, "drag")]).delta_chi2)
        plain = white.whitened(NOT_WHITENED, long_run_weights(white, white.fit([term_of(white, "drag")])))
        as_they_are.append(plain.fit([term_of(plain, "drag")]).delta_chi2)
    assert np.mean(gains) > 1.2 * np.mean(as_they_are)


def test_by_chance_a_coefficient_gains_no_more_than_one() -> None:
    """Where nothing is, Δχ² has the mean of χ² with one degree of freedom at most."""
    gains = [
        white.fit([term_of(white, "drag")]).delta_chi2
        for white in (equations_under_slow_noise(seed, 0.0) for seed in range(40))
    ]
    assert 0.2 < np.mean(gains) < 1.4


def test_a_fit_as_read_is_that_of_equations_which_are_not_whitened() -> None:
    """Coefficients, covariance, weights and columns."""
    white = equations_under_slow_noise(3, 0.3)
    fit = white.fit([term_of(white, "drag", (1,))])
    read = as_read(white, fit)
    noise = white.problem.noise_of(residual_of(white, fit))
    np.testing.assert_allclose(read.weights, noise.weights)
    plain = white.whitened(NOT_WHITENED, read.weights)
    expected = plain.fit([term_of(plain, "drag", (1,))])
    np.testing.assert_allclose(read.fit.coefficients, expected.coefficients, atol=1e-4)
    np.testing.assert_allclose(read.fit.covariance, expected.covariance, rtol=1e-3, atol=1e-7)
    assert not read.columns[1, 0].any()
    np.testing.assert_allclose(read.columns[1, 1], plain.design.columns([fit.columns[1][0]])[0, 1], atol=1e-4)


def test_weights_of_equations_that_are_not_whitened_are_the_long_run_ones() -> None:
    """They are taken as they are."""
    equations = equations_of(problem_of(table()))
    assert long_run_weights(equations, equations.fit(())) is equations.weights
