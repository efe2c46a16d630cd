"""Best subset selection on a machine of two axes whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import INSTANTS, Array, Drag, Level, Power, equations_of, group_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Prior
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.selection.best_subsets import (
    acceptable,
    best_of_each_candidate,
    best_of_each_smooth_term,
    best_subsets,
    optimised_shapes,
    passes_entry_test,
    wheels_of_faulty_sensors,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Problem, Shape
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


@pytest.fixture(scope="module")
def equations() -> NormalEquations:
    """Return the equations of a recording with a drag, and with a square of the speed."""
    return equations_of(problem_of(table(drag=0.3, factor=0.1, power=2.0)))


def test_each_candidate_s_best_shape_and_wheels_come_by_score(equations: NormalEquations) -> None:
    """The drag on both axes is first, and nothing is listed twice."""
    found = best_of_each_candidate(equations, ())
    assert next(term.name for _, term in found) == "drag"
    assert found[0][1].wheels == (0, 1)
    assert len({term.name for _, term in found}) == len(found)
    assert [score for score, _ in found] == sorted((score for score, _ in found), reverse=True)
    best = max(equations.further((), [g for g in equations.design.groups if g.name == "power"]), key=lambda p: p[0])
    assert {term.name: score for score, term in found}["power"] == pytest.approx(best[0] - equations.penalty(best[1]))


def test_what_is_given_is_not_offered_again(equations: NormalEquations) -> None:
    """Nor the same candidate on a part of the same axes."""
    beside = best_of_each_candidate(equations, [term_of(equations, "drag")])
    assert "drag" not in {term.name for _, term in beside}
    other_axis = best_of_each_candidate(equations, [term_of(equations, "drag", (0,))])
    (drag,) = [term for _, term in other_axis if term.name == "drag"]
    assert drag.wheels == (1,)


def test_smooth_terms_are_offered_by_covariate_coupling_and_number_of_wheels(equations: NormalEquations) -> None:
    """Only those that no candidate names."""
    smooth = equations.over(with_smooth_terms(equations.design))
    found = best_of_each_smooth_term(smooth, ())
    assert all(not term.group.named for _, term in found)
    kinds = [(term.name, term.group.coupling, len(term.wheels)) for _, term in found]
    assert len(set(kinds)) == len(kinds)
    taken = best_of_each_smooth_term(smooth, [found[0][1]])
    assert (found[0][1].name, found[0][1].wheels) not in {(term.name, term.wheels) for _, term in taken}


def test_a_free_shape_is_optimised_beyond_the_grid() -> None:
    """A power of 1.5 lies between the grid's 1 and 2; the equations get its column."""
    equations = equations_of(problem_of(table(factor=0.8, power=1.5)))
    size = equations.design.size
    extended, (term,) = optimised_shapes(equations, [term_of(equations, "power")])
    assert float(term.group.shape["power"]) == pytest.approx(1.5, abs=0.1)
    assert extended.design.size == size + 1
    assert equations.design.size == size
    best_on_grid = max(equations.fit([term_of(equations, "power", place=k)]).delta_chi2 for k in (0, 1))
    assert extended.fit([term]).delta_chi2 > best_on_grid


def test_the_best_sets_of_one_and_two_effects_are_the_true_ones(equations: NormalEquations) -> None:
    """Each size once, from none upwards."""
    extended, subsets = best_subsets(equations)
    assert [len(fit.terms) for fit in subsets[:3]] == [0, 1, 2]
    assert {term.name for term in subsets[2].terms} == {"drag", "power"}
    assert passes_entry_test(extended, subsets[2], subsets[1], 8.0)
    if len(subsets) > 3:
        assert not passes_entry_test(extended, subsets[3], subsets[2], 8.0)


class LightDrag(Drag):
    """A drag that cannot be large."""

    name = "light-drag"

    def plausible(self, problem: Problem, shape: Shape, values: Sequence[float]) -> bool:  # noqa: ARG002
        """Return whether it is below 0.4 V."""
        return values[0] < 0.4


class Growing(LightDrag):
    """Another that grows with the speed."""

    name = "growing"

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return ω."""
        return super().columns(problem, shape) * np.abs(problem.covariates["wheel_speed"])[None]


def test_of_two_effects_each_may_be_impossible_alone() -> None:
    """Alone, one stands for the other as well, and is too large."""
    speed = np.abs(table()["speed_rad_s"]).reshape(INSTANTS, 2)
    equations = equations_of(problem_of(table(drag=0.3 + 0.3 * speed)), (LightDrag(), Growing()))
    for name in ("light-drag", "growing"):
        assert not acceptable(equations, equations.fit([term_of(equations, name)]))
    _, subsets = best_subsets(equations)
    assert {term.name for term in subsets[-1].terms} == {"light-drag", "growing"}


class TwoKinds(Power):
    """A power of the speed, or a saturation, of which the grid is coarse."""

    name = "two-kinds"
    free: ClassVar = {"power": (0.5, 3.0), "knee": (0.05, 3.0)}

    def shapes(self, problem: Problem) -> list[Shape]:  # noqa: ARG002
        """Return a power that is nearly right, and a knee that is far off."""
        return [{"power": 0.5}, {"knee": 0.4}]

    def search_range(
        self,
        problem: Problem,  # noqa: ARG002
        shape: Shape,  # noqa: ARG002
        name: str,  # noqa: ARG002
        bounds: tuple[float, float],
    ) -> tuple[float, float]:
        """Return the whole range."""
        return bounds

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return |ω|^p, or 1 − exp(−|ω|/k)."""
        speed = np.abs(problem.covariates["wheel_speed"])[None]
        return speed ** float(shape["power"]) if "power" in shape else 1 - np.exp(-speed / float(shape["knee"]))


def test_each_kind_of_shape_that_is_near_is_optimised() -> None:
    """On the grid the power is ahead of the knee, which is the law."""
    columns = table()
    law = 0.6 * (1 - np.exp(-np.abs(columns["speed_rad_s"]) / 0.75))
    equations = equations_of(problem_of({**columns, "reading_V": columns["reading_V"] + law}), (TwoKinds(),))
    power, knee = (equations.fit([term_of(equations, "two-kinds", place=k)]) for k in (0, 1))
    assert power.delta_chi2 > knee.delta_chi2
    _, (term,) = optimised_shapes(equations, [power.terms[0]])
    assert float(term.group.shape["knee"]) == pytest.approx(0.75, rel=0.25)


def test_where_nothing_is_missing_no_effect_passes() -> None:
    """Noise alone scores less than the threshold."""
    extended, subsets = best_subsets(equations_of(problem_of(table(seed=3))))
    for more in subsets[1:]:
        assert not passes_entry_test(extended, more, subsets[0], 8.0)


def test_an_effect_too_small_to_matter_is_not_acceptable(equations: NormalEquations) -> None:
    """Below the smallest share of the mean reading, however significant."""
    drag = term_of(equations, "drag")
    assert acceptable(equations, equations.fit([drag]))
    small = equations_of(problem_of(table(drag=0.02, noise=0.01)))
    fit = small.fit([term_of(small, "drag")])
    assert fit.delta_chi2 > 5
    assert not acceptable(small, fit)


def test_an_effect_with_the_wrong_sign_is_not_acceptable() -> None:
    """A drag does not push."""
    equations = equations_of(problem_of(table(drag=-0.3)))
    assert not acceptable(equations, equations.fit([term_of(equations, "drag")]))


class Rubbing(Level):
    """A level with a drag of its own, of 0.3 V but for 0.05 V."""

    parameters: Mapping[str, Prior] = {"level": Prior(2.0, 0.5, "V"), "friction_V": Prior(0.3, 0.05, "V")}
    parameter_effects: ClassVar = {"level": "level-error", "friction_V": "drag"}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level and the drag."""
        return super().predict(inputs, values) + values["friction_V"] * np.sign(inputs["speed_rad_s"])


@pytest.mark.parametrize(("stds", "named"), [(2.0, False), (2.7, False), (8.0, True)])
def test_what_a_parameter_within_its_prior_explains_has_no_name(stds: float, *, named: bool) -> None:
    """The drag's gain is that the parameter need not leave its mean; beyond its prior the readings say so."""
    recorded = from_columns(table(drag=0.3 + 0.05 * stds), unit="axis")
    equations = equations_of(build_problem(recorded, Rubbing()))
    fit = equations.fit([term_of(equations, "drag")])
    assert fit.delta_chi2 > (stds - 0.5) ** 2
    assert acceptable(equations, fit) is named


@pytest.mark.parametrize(("own", "agrees"), [(0.3, True), (0.15, True), (0.1, False), (0.6, True), (0.9, False)])
def test_a_fault_of_another_channel_is_as_large_there(equations: NormalEquations, own: float, *, agrees: bool) -> None:
    """The drag is 0.3; the ratio to its size at home is between 0.4 and 2.5."""
    group = group_of(equations, "drag")
    fault = replace(group, own_channel=(np.full(2, 100.0), np.full(2, own)))
    fit = equations.fit([Term(fault, (0, 1))])
    assert acceptable(equations, fit) is agrees
    assert wheels_of_faulty_sensors(fit) == {0, 1}
    assert wheels_of_faulty_sensors(equations.fit([term_of(equations, "drag")])) == set()


def test_a_further_effect_must_gain_a_share_of_what_the_others_gained(equations: NormalEquations) -> None:
    """With a share of nearly all, no second effect passes; with the usual one it does."""
    _, subsets = best_subsets(equations)
    strict = equations_of(
        replace(
            equations.problem,
            thresholds=replace(equations.thresholds, further_share=0.99, remaining_share=0.99),
        )
    )
    one, both = subsets[1], subsets[2]
    more, less = (strict.fit([term_of(strict, t.name, t.wheels) for t in fit.terms]) for fit in (both, one))
    assert not passes_entry_test(strict, more, less, 8.0)


class OfEachAxis(Power):
    """A column of each axis's own."""

    sharing: ClassVar = ("all", "one")

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return |ω|^p of one axis after the other."""
        (both,) = super().columns(problem, shape)
        return np.stack([np.where(np.arange(2) == axis, both, 0.0) for axis in range(2)])


@pytest.mark.parametrize(("on", "found"), [((0.6, 0.0), (0,)), ((0.0, 0.6), (1,)), ((0.6, 0.4), (0, 1))])
def test_a_law_of_each_axis_s_own_is_on_several_only_where_they_show_it(
    on: tuple[float, float], found: tuple[int, ...]
) -> None:
    """One coefficient more gains a little by chance."""
    columns = table()
    speed = columns["speed_rad_s"].reshape(INSTANTS, 2)
    reading = columns["reading_V"].reshape(INSTANTS, 2) + np.array(on) * np.abs(speed)
    equations = equations_of(problem_of({**columns, "reading_V": reading.ravel()}), (OfEachAxis(),))
    ((_, term),) = best_of_each_candidate(equations, ())
    assert term.wheels == found
