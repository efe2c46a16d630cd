"""Inputs whose truth is no normal density: nothing of what the simulation is asked about them is biased."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.inputs.autoregressive_truths import normal_truths
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import expected_inputs
from regolithd.calibration.mismatch.problem.inputs.true_values import (
    NoisyColumn,
    NormalTruth,
    filtered_where_better,
    refined_by_density,
    smooth_where_better,
    still_at_rest,
)
from regolithd.calibration.mismatch.problem.prior import SensorError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

Array = NDArray[np.float64]
COUNT = 6000
START = np.array([0])


def ramps_and_dwells(count: int = COUNT) -> Array:
    """Return the acceleration of trapezoidal speeds: 0 but in ramps."""
    random, parts, length = np.random.default_rng(7), [], 0
    while length < count:
        ramp, height = int(random.integers(10, 40)), random.choice([-1, 1]) * random.uniform(0.5, 2)
        cruise, dwell = np.zeros(random.integers(30, 120)), np.zeros(random.integers(20, 80))
        parts += [np.full(ramp, height), cruise, np.full(ramp, -height), dwell]
        length += 2 * ramp + len(cruise) + len(dwell)
    return np.concatenate(parts)[:count]


def smooth_ramps() -> Array:
    """Return the same with rounded corners."""
    return np.convolve(ramps_and_dwells(), np.hanning(15) / np.hanning(15).sum(), mode="same")


def levels() -> Array:
    """Return a load of three levels."""
    return np.repeat(np.random.default_rng(8).choice([0.0, 1.0, 3.0], COUNT // 20), 20)


def autoregressive(instants: float) -> Array:
    """Return a normal truth with this correlation time."""
    random, kept = np.random.default_rng(9), np.exp(-1 / instants)
    truth, steps = np.zeros(COUNT), random.normal(0, np.sqrt(1 - kept**2), COUNT)
    for t in range(1, COUNT):
        truth[t] = kept * truth[t - 1] + steps[t]
    return truth


def refined(truth: Array, error: float, stated: float = 1.0) -> tuple[Array, Array]:
    """Return the autoregression's estimate of a truth read with noise, and the one by densities."""
    readings = truth + np.random.default_rng(10).normal(0, error, truth.shape)
    normal = normal_truths(readings[:, None], np.array([(stated * error) ** 2]), START).column(0)
    return normal.mean, refined_by_density(readings, stated * error, START, normal)


def slope(truth: Array, estimate: Array, law: Callable[[Array], Array]) -> float:
    """Return the coefficient of a law whose coefficient is 1, fitted with the estimate in the place of the truth."""
    there, here = law(truth), law(estimate)
    return float(np.cov(there, here)[0, 1] / np.var(here))


@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("truth", [ramps_and_dwells(), smooth_ramps(), levels()], ids=["ramps", "smooth", "levels"])
def test_laws_of_an_input_that_is_not_normal_keep_their_coefficients(truth: Array, share: float) -> None:
    """The truth, its square and its magnitude within 3 %, where the normal density has up to 12 %."""
    normal, found = refined(truth, share * float(np.std(truth)))
    for law in (np.asarray, np.square, np.abs):
        assert slope(truth, found, law) == pytest.approx(1, abs=0.03)
    assert np.std(found - truth) < 0.95 * np.std(normal - truth)


def test_a_dwell_is_zero_and_a_ramp_keeps_its_height() -> None:
    """The mean of the truth at each estimate is that estimate: nothing is left for a simulation to be blamed for."""
    truth = ramps_and_dwells()
    error = 0.2 * float(np.std(truth))
    normal, found = refined(truth, error)
    for far in (1.0, 1.5):
        there = np.abs(found) > far * np.std(truth)
        assert np.mean((truth - found)[there] * np.sign(found[there])) == pytest.approx(0, abs=0.1 * error)
    assert np.std(found[truth == 0]) < 0.35 * np.std(normal[truth == 0])


@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("instants", [1.0, 20.0, 300.0])
def test_a_normal_autoregressive_truth_has_just_its_autoregression(instants: float, share: float) -> None:
    """To the last digit."""
    normal, found = refined(autoregressive(instants), share)
    assert found is normal


@pytest.mark.parametrize("share", [0.05, 0.2, 1.0])
def test_a_slow_signal_is_no_worse(share: float) -> None:
    """A sine has another density than the normal one; hardly any of it is left to be told."""
    truth = np.sin(np.arange(COUNT) / 200) * np.sqrt(2)
    normal, found = refined(truth, share)
    assert np.std(found - truth) <= np.std(normal - truth)


@pytest.mark.parametrize("stated", [0.5, 2.0])
def test_an_error_that_is_stated_wrongly_makes_it_no_worse(stated: float) -> None:
    """Where readings contradict it, the autoregression stays."""
    normal, found = refined(smooth_ramps(), 0.2, stated)
    assert np.std(found - smooth_ramps()) <= 1.01 * np.std(normal - smooth_ramps())


def test_few_readings_and_constant_ones_stay_with_the_autoregression() -> None:
    """Densities need a hundred readings, and an error."""
    for count, error in ((99, 0.2), (COUNT, 0.0)):
        normal, found = refined(ramps_and_dwells(count), error)
        assert found is normal
    constant = normal_truths(np.full((COUNT, 1), 2.0), np.array([0.01]), START).column(0)
    np.testing.assert_allclose(refined_by_density(np.full(COUNT, 2.0), 0.1, START, constant), 2.0)


def test_a_short_recording_of_a_load_of_three_levels_is_told_by_them() -> None:
    """Of 120 to 180 readings: what an autoregression leaves of levels would look like a curve over the load."""
    before, after = [], []
    for first in range(0, COUNT - 300, 300):
        for count in (120, 150, 180):
            truth = levels()[first : first + count]
            normal, found = refined(truth, 0.3)
            before.append(np.mean((normal - truth) ** 2))
            after.append(np.mean((found - truth) ** 2))
    assert np.mean(after) < 0.5 * np.mean(before)


def test_far_offsets_and_outliers_change_nothing() -> None:
    """A column about a million is that about 0; one reading that is a code for "not measured" leaves numbers."""
    random = np.random.default_rng(15)
    readings = ramps_and_dwells() + random.normal(0, 0.2, COUNT)

    def estimate(values: Array) -> Array:
        return refined_by_density(values, 0.2, START, normal_truths(values[:, None], np.array([0.04]), START).column(0))

    np.testing.assert_allclose(estimate(readings + 1e6) - 1e6, estimate(readings), atol=1e-6)
    readings[100] = 1e15
    assert np.all(np.isfinite(estimate(readings)))


def test_unknown_readings_stay_unknown_and_exact_zeros_stay_zero() -> None:
    """A brake that reads exactly 0, and a blank, in a signal for which densities are used."""
    truth = ramps_and_dwells()
    readings = truth + np.random.default_rng(11).normal(0, 0.1, COUNT)
    readings[1000:1040], readings[2000:2500] = np.nan, 0.0
    columns = {"t_s": np.arange(COUNT) / 50, "acceleration": readings, "other": np.ones(COUNT)}
    found = expected_inputs(from_columns(columns), {"acceleration": SensorError(absolute=0.1)})
    estimate = found.channels["acceleration"][:, 0]
    normal = normal_truths(readings[:, None], np.array([0.01]), START).mean[:, 0]
    np.testing.assert_array_equal(np.isnan(estimate), np.isnan(readings))
    assert not estimate[2000:2500].any()
    told = np.isfinite(readings) & (readings != 0)
    assert np.std((estimate - truth)[told]) < 0.7 * np.std((normal - truth)[told])


def test_inputs_that_are_to_stay_normal_have_no_density() -> None:
    """Those that the speed is computed from: what is linear in the readings, or a spline."""
    truth = autoregressive(20.0) + np.repeat(np.random.default_rng(13).choice([-3.0, 3.0], COUNT // 10), 10)
    readings = truth + np.random.default_rng(12).normal(0, 0.3, COUNT)
    recording = from_columns({"t_s": np.arange(COUNT) / 50, "speed": readings})
    errors = {"speed": SensorError(absolute=0.3)}
    found = expected_inputs(recording, errors, normal={"speed"}).channels["speed"]
    before = normal_truths(readings[:, None], np.array([0.09]), START).column(0)
    column = NoisyColumn(readings, 0.3, recording.time_s, recording.run, NO_REST)
    spline = smooth_where_better(column, before)
    expected = filtered_where_better(column, spline)
    assert np.std(expected.mean - truth) < np.std(spline.mean - truth)
    np.testing.assert_allclose(found[:, 0], still_at_rest(readings, 0.3, expected).mean, rtol=1e-6)


class Arm(Simulation):
    """The torque of an inertia, with a noisy acceleration; friction is not predicted."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("acceleration_rad_s2",)
    parameters: ClassVar = {"inertia_kg_m2": Prior(0.8, 0.05, "kg·m²")}
    sensors: ClassVar = {"acceleration_rad_s2": SensorError(absolute=0.3), "speed_rad_s": SensorError(absolute=0.03)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return inertia times acceleration."""
        return values["inertia_kg_m2"] * inputs["acceleration_rad_s2"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


def test_an_arm_with_a_noisy_acceleration_keeps_its_inertia() -> None:
    """The interval holds the truth; with the normal density alone it is 5 % off, and 13 % of the residual is left."""
    random, truth = np.random.default_rng(14), ramps_and_dwells()
    columns = {
        "t_s": np.arange(COUNT) / 50,
        "torque_Nm": 0.84 * truth + random.normal(0, 0.2, COUNT),
        "acceleration_rad_s2": truth + random.normal(0, 0.3, COUNT),
        "speed_rad_s": np.cumsum(truth) / 50 + random.normal(0, 0.03, COUNT),
    }
    answer = compare(columns, Arm()).answer
    assert answer.parameters[0].low < 0.84 < answer.parameters[0].high
    assert answer.parameters[0].value == pytest.approx(0.84, rel=0.01)
    assert all(left.share_of_residual < 0.02 for left in answer.unexplained)


TIME = 0.02 * np.arange(COUNT)
ONE_RUN = np.zeros(COUNT, np.int64)
NO_REST = np.zeros(COUNT, np.bool_)


def to_and_fro() -> Array:
    """Return the speed of an oscillation of which the amplitude changes."""
    return np.sin(np.pi * TIME) * (1 + 0.3 * np.sin(TIME / 7))


def smoothed(truth: Array, error: float, stated: float = 1.0) -> tuple[Array, NormalTruth, NormalTruth]:
    """Return readings of a truth, the autoregression's estimate of it, and what the spline says where it is better."""
    readings = truth + np.random.default_rng(20).normal(0, error, truth.shape)
    deviation = stated * error
    normal = normal_truths(readings[:, None], np.array([deviation**2]), START).column(0)
    return readings, normal, smooth_where_better(NoisyColumn(readings, deviation, TIME, ONE_RUN, NO_REST), normal)


@pytest.mark.parametrize("error", [0.003, 0.01, 0.05])
def test_a_smooth_motion_has_a_speed_and_an_acceleration(error: float) -> None:
    """An eighth of the noise's power is left, as much as is said, and of the rate's noise hardly anything."""
    truth = to_and_fro()
    _, normal, found = smoothed(truth, error)
    left = float(np.mean((found.mean - truth) ** 2))
    assert left < error**2 / 8 < np.mean((normal.mean - truth) ** 2) / 2
    assert left == pytest.approx(float(np.mean(found.variance)), rel=0.4)
    rate, of_estimate = np.gradient(truth), np.gradient(found.mean)
    assert np.std(of_estimate - rate) < 0.03 * np.std(rate)


@pytest.mark.parametrize("instants", [5.0, 20.0, 300.0])
@pytest.mark.parametrize("error", [0.01, 0.1])
def test_what_is_autoregressive_is_not_smoothed(instants: float, error: float) -> None:
    """The autoregression's estimate stays, to the last digit."""
    _, normal, found = smoothed(autoregressive(instants), error)
    assert found is normal


@pytest.mark.parametrize("error", [0.003, 0.02])
def test_levels_and_ramps_keep_their_corners(error: float) -> None:
    """A fifth of the noise's power is left at most, much less than an autoregression leaves, and corners stay."""
    ramps = np.cumsum(ramps_and_dwells()) * 0.02
    for truth in (levels(), ramps):
        _, normal, found = smoothed(truth, error)
        left = float(np.mean((found.mean - truth) ** 2))
        assert left < min(error**2 / 5, 0.6 * np.mean((normal.mean - truth) ** 2))
        assert np.max(np.abs(found.mean - truth)) < 6 * error


@pytest.mark.parametrize("at", [0.1, 0.35, 0.6, 0.9])
def test_few_ramps_between_long_dwells_keep_their_corners(at: float) -> None:
    """Wherever they are: a spline that is found in the dwells would smooth them away over a hundred errors."""
    time = 0.2 * np.arange(4000)
    truth = np.interp(time / time[-1], [0.0, at, at + 0.004, 1.0], [9.0, 9.0, 3.0, 3.0])
    readings = truth + np.random.default_rng(22).normal(0, 0.03, len(time))
    recording = from_columns({"t_s": time, "speed": readings})
    for normal in (set[str](), {"speed"}):
        found = expected_inputs(recording, {"speed": SensorError(absolute=0.03)}, normal).channels["speed"][:, 0]
        assert np.max(np.abs(found - truth)) < 6 * 0.03
        assert np.sqrt(np.mean((found - truth) ** 2)) < 0.6 * 0.03


def test_an_error_that_is_stated_four_times_too_large_smooths_nothing() -> None:
    """Readings that scatter by less than that contradict it."""
    _, normal, found = smoothed(to_and_fro(), 0.01, stated=4.0)
    assert found is normal


def test_a_column_that_was_read_for_a_part_of_the_time_is_no_error() -> None:
    """Also where that part is none of those in which a spline is found."""
    time = 0.02 * np.arange(50 * COUNT)
    readings = np.full(len(time), np.nan)
    some = slice(10 * COUNT, 11 * COUNT)
    readings[some] = to_and_fro() + np.random.default_rng(21).normal(0, 0.05, COUNT)
    normal = normal_truths(readings[:, None], np.array([0.0025]), START).column(0)
    column = NoisyColumn(readings, 0.05, time, np.zeros(len(time), np.int64), np.zeros(len(time), np.bool_))
    found = smooth_where_better(column, normal)
    np.testing.assert_array_equal(np.isfinite(found.mean), np.isfinite(readings))
    assert np.std(found.mean[some] - to_and_fro()) < 0.05


def test_a_column_that_stays_at_zero_is_zero_there() -> None:
    """And nowhere else: not where it passes, nor where it creeps at two standard deviations of its noise."""
    dwells = np.where(TIME % 20 < 6, 0.0, np.sin(np.pi * (TIME % 20 - 6)))
    readings, _, found = smoothed(dwells, 0.05)
    rests = still_at_rest(readings, 0.05, found).mean == 0
    assert np.mean(rests[dwells == 0]) > 0.97
    assert np.max(np.abs(dwells[rests])) < 0.1
    readings, _, found = smoothed(np.where(TIME % 20 < 6, 0.1, dwells), 0.05)
    assert not np.any(still_at_rest(readings, 0.05, found).mean == 0)


def test_a_column_that_reads_0_at_rest_begins_to_move_from_there() -> None:
    """Where it starts and stops it has its true sign, which many readings have not, and half of their error."""
    phase = TIME % 12.0
    truth = np.where(phase < 5, np.sin(np.pi * np.clip(phase - 1, 0, 4) / 4) ** 2, 0.0) * np.sign(np.sin(TIME / 7.6))
    moving, random = truth != 0, np.random.default_rng(21)
    readings = np.where(moving, truth + random.normal(0, 0.03, COUNT), 0.0)
    recording = from_columns({"t_s": TIME, "speed": readings})
    found = expected_inputs(recording, {"speed": SensorError(absolute=0.03)}, normal={"speed"}).channels["speed"][:, 0]
    assert not found[~moving].any()
    slow = moving & (np.abs(truth) < 0.06)
    assert np.std((found - truth)[slow]) < 0.5 * np.std((readings - truth)[slow])
    assert not np.any(found * truth < 0)
    assert np.sum(readings * truth < 0) > 20
