"""Groups of the design matrix: free parameters, candidates, smooth terms and discrepancies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import CANDIDATES, INSTANTS, Drag, Level, Power, design_of, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.regression.groups.candidate_groups import coefficient_signs, with_candidate
from regolithd.calibration.mismatch.regression.groups.discrepancy_basis import discrepancy_basis
from regolithd.calibration.mismatch.regression.groups.smooth_groups import (
    PERIODIC,
    PERIODIC_OFFSET,
    couplings_of,
    has_smooth_term,
    with_periodic_terms,
    with_smooth_terms,
)
from regolithd.calibration.mismatch.regression.nuisance import with_nuisance
from regolithd.calibration.mismatch.regression.residuals import active_rms, contribution

if TYPE_CHECKING:
    from linear_machine import Array

    from regolithd.calibration.mismatch import Problem, Shape

PROBLEM = problem_of(table(drag=0.3))


def test_free_parameters_have_their_tangents_and_priors() -> None:
    """The level's tangent is 1, so that the scaled coefficient is the level's shift itself."""
    design, nuisance = with_nuisance(design_of(PROBLEM))
    assert nuisance.names == ("level",)
    np.testing.assert_allclose(nuisance.precision, [1 / 0.5**2], rtol=1e-6)
    assert design.scale[0] == pytest.approx(1.0)
    assert nuisance.with_precision(0, 7.0).precision[0] == 7.0
    assert nuisance.precision[0] == pytest.approx(4.0, rel=1e-6)


def test_each_wheel_may_have_a_deviation_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third as large as the common one, and on its own wheel."""
    monkeypatch.setattr(Level, "own_to_each_wheel", frozenset({"level"}))
    design, nuisance = with_nuisance(design_of(PROBLEM))
    assert nuisance.names == ("level", "level of 1", "level of 2")
    shift_std = 1 / np.sqrt(nuisance.precision) / design.scale[list(nuisance.columns)]
    np.testing.assert_allclose(shift_std, [0.5, 0.5 / 3, 0.5 / 3])
    assert not design.columns([1])[0, 1].any()
    assert not design.columns([2])[0, 0].any()


def test_what_acts_in_proportion_to_a_prediction_without_a_zero_does_so_about_what_is_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where nothing is predicted it is not taken for a prediction of 0."""
    prediction = np.where(np.arange(INSTANTS)[:, None] % 2, 290.0 + np.arange(INSTANTS)[:, None], np.nan)
    known = np.isfinite(prediction) & PROBLEM.mask
    monkeypatch.setattr(Level, "zero_means_nothing", True)
    problem = replace(PROBLEM, prediction=np.broadcast_to(prediction, known.shape), mask=known)
    gain = couplings_of(problem)["gain"]
    np.testing.assert_allclose(np.mean(gain, axis=0, where=known), 0.0, atol=1e-9)


def test_a_candidate_has_a_group_for_each_shape() -> None:
    """Each pays for the choice among them."""
    design, groups = with_candidate(design_of(PROBLEM), Power(), Power().shapes(PROBLEM), [1.0, 2.5])
    assert [group.columns for group in groups] == [(0,), (1,)]
    assert [group.shape["power"] for group in groups] == [1.0, 2.0]
    assert [group.noise_reduction for group in groups] == [1.0, 2.5]
    assert groups[0].selection_penalty == pytest.approx(2 * np.log(2))
    assert groups[0].signs == (1,)
    assert design.groups == groups
    with pytest.raises(ValueError, match="zip"):
        with_candidate(design, Power(), Power().shapes(PROBLEM), [1.0])


def test_columns_without_a_declared_coefficient_may_have_either_sign() -> None:
    """A ripple declares one amplitude and has two columns for each wheel."""
    assert coefficient_signs(Drag(), 1) == (1,)
    assert coefficient_signs(Drag(), 3) == (1, 0, 0)


def test_smooth_terms_cover_covariates_and_couplings() -> None:
    """Over the speed: as offset, gain and drag, and each way; over time: along the motion."""
    design = with_smooth_terms(design_of(PROBLEM))
    found = {(group.name, group.coupling, len(group.columns)) for group in design.groups}
    assert {("wheel_speed", coupling, 8) for coupling in ("offset", "gain", "drag", "each way")} <= found
    assert ("time", "drag", 48) in found
    assert not {"direction", "wheel_angle", "wheel_acceleration"} & {name for name, _, _ in found}
    assert all(not group.named and set(group.signs) == {0} for group in design.groups)


def test_the_strongest_sine_over_time_is_added() -> None:
    """Of all wheels together and of each, along the motion and whatever it is, at the frequency of the residual."""
    along = PROBLEM.covariates["direction"]
    residual = along * np.sin(2 * np.pi * 0.05 * PROBLEM.time_s) * np.array([1.0, 0.0])
    design = with_periodic_terms(design_of(PROBLEM), residual)
    assert [group.coupling for group in design.groups] == [*[PERIODIC] * 3, *[PERIODIC_OFFSET] * 3]
    group = design.groups[0]
    assert group.selection_penalty == pytest.approx(2 * np.log(PROBLEM.length_s / (5 * 0.5)))
    columns = np.stack([design.in_time(design.columns([c])[0])[:, 0] for c in group.columns], axis=1)
    left = residual[:, 0] - columns @ np.linalg.lstsq(columns, residual[:, 0], rcond=None)[0]
    assert np.sum(left**2) < 0.05 * np.sum(residual**2)


def test_discrepancies_are_shares_of_the_effect_along_its_covariate_and_on_each_wheel() -> None:
    """A constant effect varies along time; on one wheel there is nothing to differ between wheels."""
    equations = equations_of(PROBLEM)
    fit = equations.fit([term_of(equations, "drag"), term_of(equations, "power", (1,))])
    both, single = discrepancy_basis(equations, fit, 0), discrepancy_basis(equations, fit, 1)
    effect = contribution(equations, fit, 0)
    assert both.shape == (6 + 2, INSTANTS, 2)
    np.testing.assert_allclose(both[:6].sum(axis=0), effect, atol=1e-9)
    np.testing.assert_allclose(both[6:].sum(axis=0), effect, atol=1e-9)
    assert len(single) == 6
    assert not single[:, :, 0].any()


def test_an_intermittent_effect_is_as_large_as_two_fifths_of_itself() -> None:
    """A constant one is its root mean square."""
    assert active_rms(np.full(1000, 4.0), 0.4) == pytest.approx(2.0)
    now_and_then = np.zeros(1000)
    now_and_then[:10] = 4.0
    assert active_rms(now_and_then, 0.4) == pytest.approx(0.8)
    assert active_rms(np.zeros(10), 0.4) == 0


def test_every_candidate_is_in_the_design_once_for_each_shape() -> None:
    """The grid of the four candidates has one, one, two and nine shapes."""
    names = [group.name for group in equations_of(PROBLEM).design.groups]
    assert [names.count(candidate.name) for candidate in CANDIDATES] == [1, 1, 2, 9]


class EachAxis(Power):
    """A column for each axis."""

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return |ω|^p of one axis after the other, without the sign that both share."""
        (both,) = super().columns(problem, shape)
        return np.stack([np.where(np.arange(2) == axis, both, 0.0) for axis in range(2)])


def test_columns_say_on_which_wheels_they_act() -> None:
    """Where a wheel was not measured, nothing acts; one column alone acts wherever its term is."""
    mask = PROBLEM.mask.copy()
    mask[:100, 0] = mask[50:80, 1] = False
    problem = replace(PROBLEM, mask=mask)
    _, (group,) = with_candidate(design_of(problem), EachAxis(), [{"power": 1.0}])
    assert group.acting is not None
    np.testing.assert_array_equal(group.acting, [[True, False], [False, True]])
    mask[:, 1] = False
    _, (alone,) = with_candidate(design_of(replace(PROBLEM, mask=mask)), EachAxis(), [{"power": 1.0}])
    assert alone.acting is not None
    np.testing.assert_array_equal(alone.acting, [[True, False], [False, False]])
    _, (single,) = with_candidate(design_of(problem), Power(), [{"power": 1.0}])
    assert single.acting is None


@pytest.mark.parametrize(("passes", "curve"), [(1, False), (2, False), (5, True)])
def test_a_place_that_is_passed_again_is_more_than_another_name_of_the_time(passes: int, curve: bool) -> None:
    """A curve over it is tried where the way is at least three times the range of places."""
    there_and_back = np.abs((np.linspace(0, passes, INSTANTS) + 1) % 2 - 1)
    place = 100 * np.stack([there_and_back, np.full(INSTANTS, np.nan)], axis=1)
    problem = replace(PROBLEM, covariates={**PROBLEM.covariates, "place": place})
    assert has_smooth_term(problem, "place") == curve
    assert not has_smooth_term(problem, "wheel_angle")


@pytest.mark.parametrize(("name", "curve"), [("position", True), ("angle", False)])
def test_a_position_has_a_curve_where_no_other_covariate_is_the_same(name: str, curve: bool) -> None:
    """Two curves over one quantity would be two answers to one question."""
    there_and_back = np.abs((np.linspace(0, 5, INSTANTS) + 1) % 2 - 1)[:, None] * np.ones(PROBLEM.mask.shape)
    covariates = {**PROBLEM.covariates, "position": there_and_back, name: 57.3 * there_and_back}
    problem = replace(PROBLEM, covariates=covariates)
    assert has_smooth_term(problem, "position") == curve
    assert has_smooth_term(problem, name)
