"""Parameters that several channels share: their likelihoods together, and each prior once."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import equations_of, problem_of, table

from regolithd.calibration.mismatch import Prior
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Information, joint_posterior

PRIORS = {"a": Prior(10.0, 2.0), "b": Prior(1.0, 0.1), "exact": Prior(3.0)}


def seen(a: float, b: float, std: float, held: dict[str, float] | None = None) -> Information:
    """Return what a channel says that has seen a + 20 b with this standard deviation."""
    along = np.array([1.0, 20.0])
    return Information(("a", "b"), np.outer(along, along) / std**2, along * float(along @ [a, b]) / std**2, held or {})


def alone(name: str, value: float, std: float) -> Information:
    """Return what a channel says that has seen one parameter."""
    return Information((name,), np.array([[std**-2]]), np.array([value * std**-2]), {})


def test_the_posterior_is_that_of_all_readings_at_once() -> None:
    """Two combinations and the priors, against the normal equations written out."""
    found = joint_posterior(PRIORS, [seen(11.0, 1.05, 0.5), alone("b", 1.05, 0.05)])
    matrix = np.array([[1, 20], [20, 400]]) / 0.25 + np.diag([0, 400.0]) + np.diag([0.25, 100.0])
    vector = np.array([1, 20]) * 32 / 0.25 + [0, 1.05 * 400] + [10 * 0.25, 1 * 100]
    a, b, exact = found.parameters(PRIORS)
    np.testing.assert_allclose([a.value, b.value], np.linalg.solve(matrix, vector))
    stds = np.sqrt(np.diag(np.linalg.inv(matrix)))
    np.testing.assert_allclose([a.high - a.value, b.high - b.value], 1.645 * stds)
    assert (exact.low, exact.value, exact.high) == (3.0, 3.0, 3.0)


def test_the_same_readings_twice_count_the_prior_once() -> None:
    """Precisions of the readings add."""
    once, twice = (joint_posterior(PRIORS, [alone("b", 1.02, 0.1)] * count).parameters(PRIORS)[1] for count in (1, 2))
    assert once.value == pytest.approx(1.01)
    assert twice.value == pytest.approx(1 + 0.02 * 2 / 3)


def test_a_contradicted_prior_is_released_and_another_is_not() -> None:
    """One channel sees a sum, the other says whose it is: b is 6 deviations off, and a would do for half of it."""
    found = joint_posterior(PRIORS, [seen(10.0, 1.6, 0.5), alone("b", 1.6, 0.08)])
    a, b, _ = found.parameters(PRIORS)
    assert found.released == ("b",)
    assert found.restated(PRIORS)["b"] == pytest.approx((b.value, 0.1))
    assert b.value == pytest.approx(1.6, abs=0.03)
    assert not a.beyond_prior()


def test_a_prior_is_not_released_within_its_reach_or_further_than_a_wrong_statement() -> None:
    """Within three of its deviations, where that is hardly more probable than chance, and further than eight."""
    assert not joint_posterior(PRIORS, [alone("b", 1.29, 0.01)]).released
    assert not joint_posterior(PRIORS, [alone("b", 1.33, 0.01)]).released
    assert not joint_posterior(PRIORS, [alone("b", 2.0, 0.01)]).released
    assert joint_posterior(PRIORS, [alone("b", 1.6, 0.01)]).released
    assert not joint_posterior(PRIORS, [alone("b", 1.6, 0.01)], may_release=False).released


def test_a_parameter_that_a_channel_holds_has_its_value_in_all() -> None:
    """The others know what is left with it."""
    found = joint_posterior(PRIORS, [seen(11.0, 1.05, 0.5), Information((), np.zeros((0, 0)), np.zeros(0), {"b": 1.1})])
    a, b, _ = found.parameters(PRIORS)
    assert (b.low, b.value, b.high) == (1.1, 1.1, 1.1)
    assert a.value == pytest.approx((10 / 4 + 10 / 0.25) / (1 / 4 + 1 / 0.25))


def test_information_and_prior_make_the_fit() -> None:
    """Of the free parameters of one channel beside curves."""
    equations = equations_of(problem_of(table(noise=1.0)))
    nuisance = equations.nuisance
    term = equations.gains((), equations.design.groups).largest_score()
    terms = (term[1],) if term else ()
    fit, kept = equations.fit(terms), list(range(len(nuisance.columns)))
    matrix, moment = equations.information(terms, kept)
    covariance = np.linalg.inv(matrix + np.diag(nuisance.precision))
    np.testing.assert_allclose(covariance, fit.covariance[: len(kept), : len(kept)], rtol=1e-6)
    expected = covariance @ (moment + nuisance.precision * nuisance.centre)
    np.testing.assert_allclose(expected, fit.coefficients[: len(kept)], rtol=1e-6, atol=1e-9)
