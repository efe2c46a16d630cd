"""The normal equations: fits, gains and tolerances are those of explicit weighted regressions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import NOISE, Level, equations_of, group_of, problem_of, table, term_of

from regolithd.calibration.mismatch import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations, normal_equations
from regolithd.calibration.mismatch.regression.residuals import contribution, relative_size, residual_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

PRIOR_STD = 0.5


@pytest.fixture(scope="module")
def equations() -> NormalEquations:
    """Return the equations of a recording with a drag."""
    return equations_of(problem_of(table(drag=0.3)))


def gram_of(equations: NormalEquations) -> np.ndarray:
    """Return weighted sums of products of all columns, shape (wheel, column, column)."""
    columns = range(equations.design.size)
    return equations.products(columns, columns)


def explicit(equations: NormalEquations, terms: list[Term]) -> tuple[np.ndarray, float]:
    """Return coefficients and penalised weighted sum of squares of a regression on unscaled columns."""
    problem = equations.problem
    columns = [problem.tangent("level")]
    for term in terms:
        candidate = term.group.candidate
        assert candidate is not None
        on = np.isin(np.arange(2), term.wheels)
        columns += [column * on for column in candidate.columns(problem, term.group.shape)]
    matrix = np.stack([column.ravel() for column in columns], axis=1) / NOISE
    reading = (problem.measured - problem.filled).ravel() / NOISE
    prior = np.zeros((1, len(columns)))
    prior[0, 0] = 1 / PRIOR_STD
    rows, right = np.vstack((matrix, prior)), np.append(reading, 0.0)
    solved, *_ = np.linalg.lstsq(rows, right, rcond=None)
    return solved, float(np.sum((right - rows @ solved) ** 2))


def test_a_fit_is_the_penalised_least_squares_solution(equations: NormalEquations) -> None:
    """Coefficients, in the columns' own units, and Δχ² against the free parameters alone."""
    terms = [term_of(equations, "drag"), term_of(equations, "power", (1,), 1)]
    fit = equations.fit(terms)
    solved, left = explicit(equations, terms)
    columns = [column for column, _ in fit.columns]
    np.testing.assert_allclose(fit.coefficients / equations.design.scale[columns], solved, atol=2e-4)
    assert fit.delta_chi2 == pytest.approx(explicit(equations, [])[1] - left, rel=1e-4)
    assert fit.columns == ((0, (0, 1)), (terms[0].group.columns[0], (0, 1)), (terms[1].group.columns[0], (1,)))
    assert [fit.of_term(0), fit.of_term(1)] == [slice(1, 2), slice(2, 3)]
    assert fit.without(0) == (terms[1],)


def test_delta_chi2_is_the_difference_of_weighted_residual_sums(equations: NormalEquations) -> None:
    """Where the prior is weak, what the residual loses is what the set gains."""
    fit, none = equations.fit([term_of(equations, "drag")]), equations.fit(())
    lost = np.sum(residual_of(equations, none) ** 2) - np.sum(residual_of(equations, fit) ** 2)
    assert fit.delta_chi2 == pytest.approx(lost / NOISE**2, rel=1e-2)
    assert none.delta_chi2 == pytest.approx(0.0, abs=1e-6)


def test_covariance_is_that_of_the_estimates(equations: NormalEquations) -> None:
    """The drag's standard error is the noise over the root of the number of readings."""
    fit = equations.fit([term_of(equations, "drag")])
    assert np.sqrt(fit.covariance[1, 1]) == pytest.approx(NOISE / np.sqrt(1600), rel=0.05)


def test_a_further_gain_is_the_difference_of_two_fits(equations: NormalEquations) -> None:
    """For every group, on all wheels and on each, beside a term."""
    given = [term_of(equations, "drag")]
    base = equations.fit(given).delta_chi2
    found = equations.further(given)
    assert {term.wheels for _, term in found} == {(0, 1), (0,), (1,)}
    for gain, term in found:
        assert gain == pytest.approx(equations.fit([*given, term]).delta_chi2 - base, rel=1e-3, abs=1e-3)


def test_the_largest_score_is_that_of_all_terms(equations: NormalEquations) -> None:
    """Of terms in any order, and none of none."""
    gain, term = max(equations.further(()), key=lambda pair: pair[0] - equations.penalty(pair[1]))
    found = equations.gains((), equations.design.groups[::-1])
    assert found.largest_score() == (pytest.approx(gain - equations.penalty(term)), term)
    assert equations.gains((), ()).largest_score() is None


def test_a_wrong_sign_gains_nothing() -> None:
    """A drag that drives is none; an offset may have either sign."""
    equations = equations_of(problem_of(table(drag=-0.3)))
    names = {term.name for _, term in equations.further(())}
    assert "drag" not in names
    assert equations.fit([term_of(equations, "drag")]).coefficients[1] < 0


def test_tolerance_is_one_over_the_variance_inflation(equations: NormalEquations) -> None:
    """An offset is nearly the level; a drag is hardly."""
    offset, drag = term_of(equations, "offset"), term_of(equations, "drag")
    assert equations.tolerance((), offset) < 0.01
    assert equations.tolerance((), drag) > 0.9
    column = equations.problem.covariates["direction"].ravel()
    other = np.abs(equations.problem.covariates["wheel_speed"]).ravel()
    one = np.ones(len(column))
    vif_columns = np.stack((one, column), axis=1)
    left = other - vif_columns @ np.linalg.lstsq(vif_columns, other, rcond=None)[0]
    power = term_of(equations, "power")
    assert equations.tolerance([drag], power) == pytest.approx(float(left @ left / (other @ other)), rel=0.01)
    own, complement = equations.own_and_complement([drag], power)
    assert own.shape == complement.shape == (1, 1)


def test_the_score_is_the_gain_less_penalties(equations: NormalEquations) -> None:
    """Less noise at a line's frequencies makes its own energy count by so much more."""
    term = term_of(equations, "drag")
    fit = equations.fit([term])
    assert equations.score(fit) == pytest.approx(fit.delta_chi2 - equations.penalty(term))
    quiet = Term(replace(term.group, noise_reduction=3.0), term.wheels)
    energy = fit.coefficients[1] ** 2 * equations.energies(term.group.columns[:1]).sum()
    assert equations.score(equations.fit([quiet])) == pytest.approx(equations.score(fit) + 2 * energy)
    gains = [gain for gain, _ in equations.further((), [term.group, quiet.group])]
    np.testing.assert_allclose(gains[1::2], 3 * np.array(gains[0::2]))


def test_other_weights_make_other_equations(equations: NormalEquations) -> None:
    """Four times the weight is four times the gain; the equations themselves do not change."""
    gram = gram_of(equations).copy()
    heavier = equations.weighted(4 * equations.weights)
    terms = [term_of(equations, "drag")]
    assert heavier.fit(terms).delta_chi2 == pytest.approx(4 * equations.fit(terms).delta_chi2, rel=1e-2)
    np.testing.assert_array_equal(gram_of(equations), gram)
    assert equations.weighted(equations.weights.copy()) is equations


def test_further_columns_leave_earlier_sums_alone(equations: NormalEquations) -> None:
    """Equations over an extended design are those that are made of it anew."""
    design, (place,) = equations.design.extended([equations.problem.covariates["wheel_speed"] ** 3])
    extended = equations.over(design)
    anew = normal_equations(design, equations.nuisance, equations.weights)
    gram = gram_of(extended)
    np.testing.assert_array_equal(gram, gram_of(anew))
    np.testing.assert_array_equal(extended.moment, anew.moment)
    np.testing.assert_allclose(gram, np.swapaxes(gram, 1, 2), rtol=1e-5)  # products of float32
    assert gram_of(equations).shape[1] == place


def test_folds_add_up(equations: NormalEquations) -> None:
    """The sums over single folds are the sum over all."""
    parts = [gram_of(normal_equations(equations.design, equations.nuisance, equations.weights, [k])) for k in range(5)]
    np.testing.assert_allclose(sum(parts), gram_of(equations))


def test_a_term_s_contribution_is_coefficient_times_column(equations: NormalEquations) -> None:
    """On its wheels only, and its size is measured against the mean reading."""
    fit = equations.fit([term_of(equations, "drag", (1,))])
    added = contribution(equations, fit, 0)
    assert not added[:, 0].any()
    direction = equations.problem.covariates["direction"][:, 1]
    np.testing.assert_allclose(added[:, 1], added[:, 1].max() * direction, atol=1e-6)
    assert added[:, 1].max() == pytest.approx(0.3, abs=0.03)
    mean = float(np.mean(np.abs(equations.problem.measured)))
    assert relative_size(equations, fit, 0) == pytest.approx(np.abs(added[:, 1]).mean() / mean, rel=1e-3)


def test_wheels_that_share_are_all_each_and_what_the_simulation_names(equations: NormalEquations) -> None:
    """Two axes without sides and rows have no other sets."""
    assert equations.wheel_sets == {(0,): "one", (1,): "one", (0, 1): "all"}
    assert group_of(equations, "drag").may_be_shared("some")


class BySides(Level):
    """The level, on a machine whose first axis is its left side and whose second is its right."""

    def side(self, wheels: Sequence[int | str]) -> NDArray[np.float64]:
        """Return the sides."""
        return np.array([-1.0, 1.0])[: len(wheels)]


def test_a_side_of_one_wheel_is_one_wheel() -> None:
    """What only one wheel can have is looked for there too."""
    problem = build_problem(from_columns(table(), unit="axis"), BySides())
    found = equations_of(problem)
    assert found.wheel_sets == {(0,): "one", (1,): "one", (0, 1): "all"}


def test_priors_of_any_unit_leave_the_fit_as_it_is(equations: NormalEquations) -> None:
    """A parameter with a tiny standard deviation, which the channel does not depend on, changes no fit."""
    found = equations.fit([term_of(equations, "drag", (0, 1))])
    nuisance = equations.nuisance
    column, columns = equations.design.extended([np.zeros(equations.problem.mask.shape)])
    more = replace(
        nuisance,
        names=(*nuisance.names, "unused"),
        columns=(*nuisance.columns, *columns),
        precision=np.append(nuisance.precision, 1e18),
        centre=np.append(nuisance.centre, 0.0),
    )
    again = equations.over(column).with_nuisance(more).fit(found.terms)
    assert again.delta_chi2 == pytest.approx(found.delta_chi2, rel=1e-9)


def test_a_parameter_that_acts_on_nothing_and_has_no_prior_changes_no_fit(equations: NormalEquations) -> None:
    """As one of two channels' parameters in the other channel, once its prior is lifted."""
    design, (silent,) = equations.design.extended([np.zeros(equations.problem.mask.shape)])
    held = equations.nuisance
    nuisance = replace(
        held,
        names=(*held.names, "silent"),
        columns=(*held.columns, silent),
        precision=np.append(held.precision, 0.0),
        centre=np.append(held.centre, 0.0),
    )
    wider = replace(equations, design=design, nuisance=nuisance)
    term = term_of(equations, "drag")
    assert wider.fit([term]).delta_chi2 == pytest.approx(equations.fit([term]).delta_chi2)
