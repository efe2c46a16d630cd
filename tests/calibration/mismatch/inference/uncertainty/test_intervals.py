"""Intervals: sandwich covariance, sizes and onsets of effects whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import CANDIDATES, NOISE, Power, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Prior, Simulation, compare, from_columns
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay
from regolithd.calibration.mismatch.inference.uncertainty.intervals import (
    drawn_from,
    law_stds_of,
    normal_draws,
    parameters_of,
    unit_of,
)
from regolithd.calibration.mismatch.inference.uncertainty.parameter_interval import interval
from regolithd.calibration.mismatch.inference.uncertainty.sandwich import StatedShare, block_sums, linearised, sandwich
from regolithd.calibration.mismatch.inference.uncertainty.size_interval import _over_kinds_of_shape, _rms
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.selection.shape_optimisation import optimised_shape
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Parameter
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

    Array = NDArray[np.float64]

WHITE = NoiseModel(np.full(2, NOISE), 1.0)
ONE = NoiseModel(np.full(1, NOISE), 1.0)


def exact_law(equations: NormalEquations) -> NormalEquations:
    """Return equations whose laws are taken as exact: the intervals are then those of the noise."""
    problem = replace(equations.problem, thresholds=replace(equations.thresholds, discrepancy_std=1e-4))
    return replace(equations, design=replace(equations.design, problem=problem))


def test_block_sums_keep_wheels_apart() -> None:
    """One row for each block of each wheel."""
    scores = np.arange(24.0).reshape(2, 6, 2)
    blocks = np.array([0, 0, 0, 1, 1, 2])
    sums = block_sums(scores, blocks)
    assert sums.shape == (6, 2)
    np.testing.assert_allclose(sums[0], scores[:, :3, 0].sum(axis=1))
    np.testing.assert_allclose(sums[3], scores[:, 3:5, 1].sum(axis=1))


def test_the_sandwich_of_white_noise_is_the_inverse_information() -> None:
    """And the fit's own coefficients do not move."""
    equations = exact_law(equations_of(problem_of(table(drag=0.3))))
    fit = equations.fit([term_of(equations, "drag")])
    blocks = blocks_of_time(equations.problem, WHITE)
    linearisation = linearised(equations, fit)
    found = sandwich(equations, fit, linearisation, blocks)
    assert np.abs(found.step[:2]).max() < 1e-3
    assert np.sqrt(found.covariance[1, 1]) == pytest.approx(np.sqrt(fit.covariance[1, 1]), rel=0.35)
    assert linearisation.of_term(fit, 0) == [1, *range(2, len(linearisation.columns))]
    np.testing.assert_allclose(np.diag(linearisation.precision)[2:], 1e8)
    np.testing.assert_allclose(found.inverse[:2, :2], fit.covariance, rtol=0.01)


def intervals(equations: NormalEquations, fit: Fit, noise: NoiseModel) -> list[dict[str, Parameter]]:
    """Return the intervals of the terms of a fit."""
    return parameters_of(equations, fit, drawn_from(equations, fit, blocks_of_time(equations.problem, noise)))


def test_a_law_is_carried_to_another_recording_as_its_coefficient_is_known() -> None:
    """The discrepancy that makes up for it here is another one there: its size is known better than the law."""
    equations = equations_of(problem_of(table(drag=0.3)))
    fit = equations.fit([term_of(equations, "drag")])
    drawn = drawn_from(equations, fit, blocks_of_time(equations.problem, WHITE))
    (found,), (std,) = parameters_of(equations, fit, drawn), law_stds_of(fit, drawn)
    drag, size = found["drag"], found["relative_size"]
    assert std == pytest.approx((drag.high - drag.low) / (2 * 1.645 * drag.value), rel=0.1)
    assert std > 1.2 * (size.high - size.low) / (2 * 1.645 * size.value)


def test_a_coefficient_and_a_power_that_make_up_for_each_other_leave_the_law() -> None:
    """It is known better than its coefficient."""
    equations = exact_law(equations_of(problem_of(table(factor=0.8, power=1.5))))
    equations, term = optimised_shape(equations, (), term_of(equations, "power"))
    fit = equations.fit([term])
    drawn = drawn_from(equations, fit, blocks_of_time(equations.problem, WHITE))
    (found,), (std,) = parameters_of(equations, fit, drawn), law_stds_of(fit, drawn)
    factor = next(each for name, each in found.items() if name not in {"power", "relative_size"})
    assert std < 0.7 * (factor.high - factor.low) / (2 * 1.645 * factor.value)


def test_nine_in_ten_intervals_hold_the_truth() -> None:
    """On simulated linear data, over forty seeds."""
    held = 0
    for seed in range(40):
        equations = exact_law(equations_of(problem_of(table(drag=0.3, seed=seed))))
        fit = equations.fit([term_of(equations, "drag")])
        (found,) = intervals(equations, fit, WHITE)
        held += found["drag"].low <= 0.3 <= found["drag"].high
        assert found["drag"].low < found["drag"].value < found["drag"].high
    assert 31 <= held <= 40


def test_a_law_may_be_wrong_by_a_share_at_each_knot_and_on_each_axis() -> None:
    """The fit is linearised with discrepancies whose prior has the stated deviation."""
    equations = equations_of(problem_of(table(drag=0.3)))
    fit = equations.fit([term_of(equations, "drag")])
    linearisation = linearised(equations, fit)
    assert linearisation.columns.shape == (2 + 6 + 2, *equations.problem.mask.shape)
    np.testing.assert_allclose(np.diag(linearisation.precision), [4.0, 0.0, *[0.15**-2] * 8], rtol=1e-5)
    blocks = blocks_of_time(equations.problem, WHITE)
    deviations = [
        np.sqrt(sandwich(each, fit, linearised(each, fit), blocks).covariance[1, 1])
        for each in (exact_law(equations), equations)
    ]
    assert deviations[1] > 1.3 * deviations[0], "the coefficient and its discrepancies share what is known"


def test_relative_size_is_the_effect_over_the_mean_reading() -> None:
    """A drag of 0.3 at a mean of about 2."""
    equations = equations_of(problem_of(table(drag=0.3)))
    (found,) = intervals(equations, equations.fit([term_of(equations, "drag")]), WHITE)
    size = found["relative_size"]
    assert size.value == pytest.approx(0.3 / float(np.mean(np.abs(equations.problem.measured))), rel=0.1)
    assert size.low < size.value < size.high
    assert (size.unit, found["drag"].unit) == ("1", "V")


def test_no_size_is_known_better_than_the_common_discrepancy() -> None:
    """With hardly any noise its coefficient is known to a thousandth, its size is not."""
    equations = equations_of(problem_of(table(drag=0.3, noise=0.001)))
    (found,) = intervals(equations, equations.fit([term_of(equations, "drag")]), WHITE)
    size = found["relative_size"]
    assert (size.high - size.low) / (2 * 1.645 * size.value) > 0.95 * THRESHOLDS.size_discrepancy_std


def test_a_drag_is_no_thrust() -> None:
    """Where hardly anything tells a factor from its power, the factor's interval still keeps its sign."""
    equations = equations_of(problem_of(table(factor=0.02, power=1.5, noise=0.2)), CANDIDATES)
    fit = equations.fit([term_of(equations, "power")])
    (found,) = intervals(equations, fit, equations.problem.noise_of(equations.problem.residual))
    assert 0 <= found["factor"].low < found["factor"].value < found["factor"].high


def test_a_shape_parameter_has_its_interval() -> None:
    """The power of a curve of power 1.5."""
    equations = equations_of(problem_of(table(factor=0.8, power=1.5)))
    equations, term = optimised_shape(equations, (), term_of(equations, "power"))
    (found,) = intervals(equations, equations.fit([term]), WHITE)
    assert found["power"].low <= 1.5 <= found["power"].high
    assert found["power"].high - found["power"].low < 0.6


def test_a_larger_share_than_one_gives_way_to_the_best_fit_at_one() -> None:
    """As least squares with the share held at 1 has it; draws below are as they were."""
    random = np.random.default_rng(2)
    columns, along = random.normal(size=(60, 3)), np.array([0.5, -0.2, 0.0])
    information = columns.T @ columns
    best = np.linalg.solve(information, columns.T @ random.normal(size=60))
    moved = np.stack((best, best - 2 * along))
    stated = StatedShare(1.3 - float(along @ best), 0.2, along)
    held, below = stated.at_most_one(moved, np.linalg.inv(information))
    assert stated.share + held @ along == pytest.approx(1.0)
    free = np.array([[0.2, 0.0], [0.5, 0.0], [0.0, 1.0]])  # directions in which the share stays
    assert free.T @ information @ (held - best) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_array_equal(below, moved[1])


class Slow(Simulation):
    """A reading that follows a slow input."""

    channel, unit, wheel_column = "reading_V", "V", None
    inputs = ("level_V",)
    parameters: ClassVar = {"gain": Prior(1.0, 0.01, "1")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the input times the gain."""
        return values["gain"] * inputs["level_V"]


def test_a_delay_whose_change_is_in_proportion_to_it_has_its_interval() -> None:
    """Only that all of the change is recorded tells a delay from another of a part of it: over forty seeds."""
    held, widths = 0, []
    t_s = 0.5 * np.arange(800)
    level = 4 * np.sin(t_s / 13) + 3 * np.sin(t_s / 29)
    for seed in range(40):
        recorded = np.interp(t_s - 2.0, t_s, level) + 0.6 * np.random.default_rng(seed).normal(size=800)
        recording = from_columns({"t_s": t_s, "level_V": level, "reading_V": recorded})
        equations = exact_law(equations_of(build_problem(recording, Slow()), (SensorDelay(),)))
        equations, term = optimised_shape(equations, (), term_of(equations, "sensor-delay", (0,)))
        (found,) = intervals(equations, equations.fit([term]), ONE)
        delay = found["delay_s"]
        held += delay.low <= 2.0 <= delay.high
        widths.append(delay.high - delay.low)
    assert 33 <= held <= 40
    assert np.median(widths) < 1.2


class Bent(Power):
    """A power of the speed whose power is one of two kinds, not a continuous parameter."""

    free: ClassVar = {}


def test_kinds_of_shape_count_where_they_are_likely() -> None:
    """A power that the data exclude has no draws, unless every kind is to count: then one at least."""
    equations = equations_of(problem_of(table(factor=0.8, power=2.0)), (Bent(),))
    fit = equations.fit([term_of(equations, "power", place=1)])
    sizes, value = np.linspace(0.9, 1.1, 100), _rms(equations, fit, 0)
    (drawn,) = _over_kinds_of_shape(equations, fit, 0, sizes, value)
    np.testing.assert_allclose(drawn, sizes)
    every = replace(equations.problem, thresholds=replace(equations.thresholds, least_likelihood_ratio=0.0))
    equations = replace(equations, design=replace(equations.design, problem=every))
    assert sorted(map(len, _over_kinds_of_shape(equations, fit, 0, sizes, value))) == [1, 100]


def test_an_onset_has_bounds_on_both_sides_within_the_recording() -> None:
    """A step of half a volt at 231 s is known to a few seconds."""
    columns = table()
    columns["reading_V"] = columns["reading_V"] + 0.5 * (columns["t_s"] >= 231)
    equations = equations_of(problem_of(columns))
    equations, term = optimised_shape(equations, (), term_of(equations, "step", place=5))
    (found,) = intervals(equations, equations.fit([term]), WHITE)
    onset = found["onset_s"]
    assert 0 <= onset.low <= 231 <= onset.high <= equations.problem.length_s
    assert 0.1 < onset.high - onset.low < 10
    assert onset.unit == "s"


def test_draws_have_the_covariance_that_is_asked() -> None:
    """And are the same every time."""
    covariance = np.array([[2.0, 0.6], [0.6, 0.5]])
    drawn = normal_draws(covariance, 4000)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.15)
    np.testing.assert_array_equal(drawn, normal_draws(covariance, 4000))


def test_a_value_is_within_its_own_interval() -> None:
    """Even where all draws are to one side, and never on its edge."""
    found = interval(1.0, [2.0, 3.0, 4.0], "V")
    assert (found.value, found.unit) == (1.0, "V")
    assert found.low == pytest.approx(1.0 - 0.05 * 1.8)
    assert found.high == pytest.approx(3.9)
    assert interval(5.0, [2.0, 3.0, 4.0], "V").high == pytest.approx(5.0 + 0.05 * 1.8)


def test_an_interval_stays_within_declared_bounds() -> None:
    """Draws beyond the bounds are impossible, and a value on a bound gives way to the middle of the others."""
    drawn = np.linspace(-1.0, 1.0, 2001)
    found = interval(0.0, drawn, "s", (0.0, 0.5))
    assert (found.low, found.value, found.high) == pytest.approx((0.025, 0.125, 0.475), abs=1e-3)
    kept = interval(0.3, drawn, "s", (0.0, 0.5))
    assert kept.value == 0.3
    assert interval(1.35, [1.2, 1.3, 1.5], "1", (0.7, 1.4)).high <= 1.4


@pytest.mark.parametrize(("mean", "bounds", "sign"), [(-5.0, (0.0, 10.0), 1.0), (5.0, (-np.inf, 0.0), -1.0)])
def test_of_draws_beyond_a_bound_the_tail_is_left(mean: float, bounds: tuple[float, float], sign: float) -> None:
    """A normal density of standard deviation 1 falls by a factor e over a fifth, five deviations from its mean."""
    drawn = np.random.default_rng(0).normal(mean, 1.0, 200)
    found = interval(0.0, drawn, "s", bounds)
    assert min(abs(found.low), abs(found.high)) < abs(found.value) < max(abs(found.low), abs(found.high))
    assert found.value * sign == pytest.approx(0.2 * np.log(4 / 3), rel=0.2)
    assert max(found.low * sign, found.high * sign) == pytest.approx(0.2 * np.log(10), rel=0.2)
    assert 0.0 in (found.low, found.high)


def test_an_interval_holds_a_bound_that_a_tail_is_beyond() -> None:
    """A power of 1 that nothing may exceed: nine tenths of the draws within are above its lower end."""
    drawn = np.random.default_rng(1).normal(0.98, 0.05, 400)
    inside = drawn[drawn <= 1.0]
    found = interval(0.99, drawn, "1", (0.0, 1.0))
    assert found.high == 1.0
    assert found.low == pytest.approx(np.quantile(inside, 0.1))
    assert interval(0.5, drawn - 0.48, "1", (0.0, 1.0)).high < 1.0


@pytest.mark.parametrize(
    ("name", "unit"), [("scale_K", "K"), ("onset_s", "s"), ("speed_rad_s", "rad/s"), ("end_degC", "degC"), ("p", "1")]
)
def test_a_shape_parameter_s_name_ends_in_its_unit(name: str, unit: str) -> None:
    """Without an ending that is known it has none."""
    assert unit_of(name, {}) == unit


class Fan(Simulation):
    """Torque of a fan whose speed is in revolutions per minute."""

    channel, unit = "torque_Nm", "Nm"
    inputs = ("speed_rpm", "vane_deg")
    parameters: ClassVar = {"per_degree": Prior(0.4, 0.01, "Nm/deg")}
    one_way = True
    covariate_labels: ClassVar = {"wheel_speed": "speed (rpm)"}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque that the vanes take."""
        return values["per_degree"] * inputs["vane_deg"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rpm"]}


def test_a_coefficient_goes_with_the_exponent_that_is_told() -> None:
    """A unit of speed is far from all readings: the law is known, its coefficient by a factor alone, and above 0."""
    generator = np.random.default_rng(3)
    time_s = 0.2 * np.arange(4000)
    speed = np.repeat(generator.uniform(500, 1300, 40), 100)
    vane = 30 + 8 * np.sin(time_s / 31)
    torque = 0.4 * vane + 0.0025 * speed + generator.normal(0, 1.0, 4000)
    columns = {"t_s": time_s, "speed_rpm": speed, "vane_deg": vane, "torque_Nm": torque}
    (effect,) = compare(from_columns(columns), Fan()).answer.effects
    drag, power = effect.parameters["viscous_coefficient"], effect.parameters["power"]
    assert effect.name == "viscous-friction"
    assert drag.value * 900**power.value == pytest.approx(0.0025 * 900, rel=0.15)
    assert 0 < drag.low < 0.0025 < drag.high
    assert drag.high / drag.low > 3
