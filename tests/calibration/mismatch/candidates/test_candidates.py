"""Every candidate of the contract is there, tells what it is, and returns columns of its physics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rover_drives import columns, recording, simulation

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.candidates.load_cell_drift import DriftOfPredictedLoad
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

CONTRACT = {
    "coulomb-friction": "direction",
    "viscous-friction": "wheel_speed",
    "stribeck-friction": "wheel_speed",
    "cold-lubricant-friction": "temperature",
    "load-dependent-efficiency": "torque",
    "torque-constant-temperature": "temperature",
    "rotor-inertia": "wheel_acceleration",
    "wheel-angle-ripple": "wheel_angle",
    "grade-resistance": "pitch",
    "turning-resistance": "yaw_rate",
    "slip-sinkage": "slip",
    "multi-pass-compaction": "wheel_row",
    "soil-transition": "time",
    "load-cell-drift": "time",
    "current-sensor-bias": "none",
    "bearing-drag": "time",
}


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Return a short drive."""
    return build_problem(recording(length_s=120.0), simulation())


def test_the_library_has_every_name_of_the_contract_with_its_covariate() -> None:
    """The list is a floor."""
    assert {c.name: c.covariate for c in library()}.items() >= CONTRACT.items()


@pytest.mark.parametrize("candidate", library(), ids=lambda c: c.name)
def test_a_candidate_tells_what_it_is_and_has_finite_columns(candidate: Candidate, problem: Problem) -> None:
    """Equation, words, signature, experiment and source; columns of the recording's shape, a coefficient each."""
    for told in (candidate.equation, candidate.words, candidate.signature, candidate.experiment, candidate.source):
        assert len(told) > 5
    shapes = [*candidate.shapes(problem), *candidate.propose_shapes(problem, np.where(problem.mask, 0.001, 0.0))]
    assert shapes or not candidate.applies(problem)
    for shape in shapes[:: max(1, len(shapes) // 5)]:
        columns = candidate.columns(problem, shape)
        assert columns.shape[1:] == problem.mask.shape
        assert np.isfinite(columns[:, problem.mask]).all()
        assert candidate.parameters(shape, [1.0] * len(columns))


def test_friction_changes_sign_with_rotation_and_slope_does_not(problem: Problem) -> None:
    """What tells Coulomb friction, a sensor's bias and the slope apart."""
    by_name = {c.name: c for c in library()}
    direction = problem.covariates["direction"]
    drag = by_name["coulomb-friction"].columns(problem, {})[0]
    np.testing.assert_array_equal(drag[problem.mask], direction[problem.mask])
    slope = by_name["grade-resistance"].columns(problem, {"shared": "evenly"})[0]
    np.testing.assert_allclose(slope, np.sin(problem.covariates["pitch"]))


def test_a_temperature_that_no_wheel_changes_is_no_reason_to_call_friction_cold(problem: Problem) -> None:
    """Wheels that differ by a kelvin and stay there say nothing of grease, nor of magnets; one that warms does."""
    steady = np.broadcast_to(np.linspace(0.8, 1.6, 6), problem.mask.shape)
    kept = replace(problem, covariates={**problem.covariates, "temperature": steady})
    by_name = {c.name: c for c in library()}
    cold, magnets = by_name["cold-lubricant-friction"], by_name["torque-constant-temperature"]
    assert all(cold.prior_penalty(kept, shape) > 5 for shape in cold.shapes(kept))
    assert all(magnets.prior_penalty(kept, shape) > 5 for shape in magnets.shapes(kept))
    assert any(cold.prior_penalty(problem, shape) == 0 for shape in cold.shapes(problem))
    assert any(magnets.prior_penalty(problem, shape) == 0 for shape in magnets.shapes(problem))
    drag = [cold.columns(kept, shape)[0] for shape in cold.shapes(kept) if shape["power"] == 0.0]
    assert min(float(np.min(np.abs(d[kept.mask]))) for d in drag) > 0.5, "no grease loses its drag within a kelvin"


def test_a_wheel_whose_temperature_nobody_measured_does_not_hide_that_the_others_warm(problem: Problem) -> None:
    """What varies on a wheel is the mean over the wheels of which it is known."""
    values = problem.covariates["temperature"].copy()
    before = problem.variance_within(values)
    values[:, 2] = np.nan
    assert problem.variance_within(values) == pytest.approx(before)


@pytest.mark.parametrize("true", [0.002, 0.012])
def test_a_torque_constant_is_bent_by_its_own_coefficient(problem: Problem, true: float) -> None:
    """k_t = k_0 (1 − α ΔT) makes the current I/(1 − α ΔT), not I (1 + α ΔT): thirty kelvin away that matters."""
    candidate = next(c for c in library() if c.name == "torque-constant-temperature")
    cold = replace(problem, covariates={**problem.covariates, "temperature": problem.covariates["temperature"] - 30})
    warmer = cold.covariates["temperature"] - 20.0
    effect = np.where(cold.mask, cold.filled * (1 / (1 - true * warmer) - 1), 0.0)
    shape: Shape = {"reference_degC": 20.0, "bent_per_K": 0.0}
    for _ in range(6):
        column = np.where(cold.mask, candidate.columns(cold, shape)[0], 0.0)
        fitted = float(np.sum(column * effect) / np.sum(column**2))
        shape = candidate.self_consistent_shape(cold, shape, [fitted])
    assert fitted == pytest.approx(true, rel=0.03)


def test_a_torque_constant_refers_to_the_stated_temperature(problem: Problem) -> None:
    """Else to that of data sheets, unless another gains much more; the words say to which."""
    candidate = next(c for c in library() if c.name == "torque-constant-temperature")
    shapes = candidate.shapes(problem)
    charged = {shape["reference_degC"]: candidate.prior_penalty(problem, shape) for shape in shapes}
    assert charged[25.0] == charged[20.0] < charged[0.0]
    told = simulation()
    told.motor_constant_at_degC = 18.0
    stated = replace(problem, simulation=told)
    (shape,) = candidate.shapes(stated)
    assert shape["reference_degC"] == 18.0
    assert candidate.prior_penalty(stated, shape) == charged[25.0]
    assert candidate.words_for(shape).endswith("above 18 °C")
    assert candidate.words_for({}) == candidate.words


def test_an_efficiency_that_falls_with_torque_bends_the_current(problem: Problem) -> None:
    """η (1 − a x), x the torque above its mean: the current is I/(1 − a x), and a is found."""
    candidate = next(c for c in library() if c.name == "load-dependent-efficiency")
    above = np.abs(problem.filled) / np.mean(np.abs(problem.filled[problem.mask])) - 1
    effect = np.where(problem.mask, problem.filled * (1 / (1 - 0.3 * above) - 1), 0.0)
    shape: Shape = {"bent": 0.0, "reference_size": float(np.mean(np.abs(problem.filled[problem.mask])))}
    for _ in range(8):
        column = np.where(problem.mask, candidate.columns(problem, shape)[0], 0.0)
        fitted = float(np.sum(column * effect) / np.sum(column**2))
        shape = candidate.self_consistent_shape(problem, shape, [fitted])
    assert fitted == pytest.approx(0.3, rel=0.05)


def test_no_ripple_is_sought_that_the_readings_cannot_tell_from_a_drag() -> None:
    """At one speed a constant drag is the image of every ripple with a whole number of cycles between two readings."""
    steady = build_problem(recording(length_s=120.0, speed=0.4), simulation())
    candidate = next(c for c in library() if c.name == "wheel-angle-ripple")
    cycles = [
        float(s["order"]) * 0.4 * 0.2 / (2 * np.pi) for s in candidate.propose_shapes(steady, 0.003 * steady.mask)
    ]
    assert max(cycles) <= 1 / 2.5


def test_a_ripple_is_found_whether_a_speed_is_of_the_instant_or_of_the_time_before(problem: Problem) -> None:
    """Angle summed from speeds lags by half a reading; the phase of a high order does not forgive that."""
    candidate = next(c for c in library() if c.name == "wheel-angle-ripple")
    summed = np.cumsum(problem.covariates["wheel_speed"], axis=0) * 0.2
    ripple = np.where(problem.mask, 0.004 * np.cos(16 * summed), 0.0)
    shapes = [shape for shape in candidate.propose_shapes(problem, ripple) if shape["kind"] == "torque"]
    left = []
    for shape in shapes:
        columns = np.where(problem.mask, candidate.columns(problem, shape), 0.0).reshape(-1, ripple.size)
        fitted = np.linalg.lstsq(columns.T, ripple.ravel(), rcond=None)[0]
        left.append(float(np.std(ripple.ravel() - fitted @ columns)))
    assert min(left) < 0.1 * float(np.std(ripple))


def test_a_slope_that_changes_slowly_does_not_take_a_drift_along() -> None:
    """Pitch and drift both rise over the recording; the cell still shows most of what it drifted."""
    table = columns(length_s=240.0)
    share = table["t_s"] / 240.0
    table["pitch_rad"] = 0.08 * share + 0.02 * np.sin(table["t_s"] / 9)
    table["load_N"] = np.where(table["wheel"] == 2, table["load_N"] - 20 * share, table["load_N"])
    problem = build_problem(from_columns(table), simulation())
    candidate = next(c for c in library() if c.name == "load-cell-drift")
    seen, _ = candidate.own_channel_evidence(problem, {"relative_offset": 0.0}) or (np.zeros(6), None)
    assert int(np.argmax(seen)) == 1
    assert seen[1] > 25
    assert np.all(np.delete(seen, 1) < 0.2 * seen[1])


def test_inertia_may_come_late(problem: Problem) -> None:
    """The column a reading and a half late lies halfway between those one and two readings late."""
    candidate = next(c for c in library() if c.name == "rotor-inertia")
    step_s = problem.recording.step_s
    at_once, one, between, two = (candidate.columns(problem, {"lag_s": n * step_s})[0] for n in (0.0, 1.0, 1.5, 2.0))
    assert np.array_equal(at_once, problem.covariates["wheel_acceleration"])
    assert np.allclose(one[1:], at_once[:-1])
    assert np.allclose(two[2:], at_once[:-2])
    assert np.allclose(between, 0.5 * (one + two))


@pytest.mark.parametrize("candidate", library(), ids=lambda c: c.name)
def test_every_shape_has_one_of_the_forms(candidate: Candidate, problem: Problem) -> None:
    """Each form that is documented is searched, and each shape that is searched has a documented form."""
    at_first = np.arange(len(problem.time_s))[:, None] < len(problem.time_s) // 10
    direction = np.where(at_first, 0.0, problem.covariates["direction"])
    resting = replace(problem, covariates={**problem.covariates, "direction": direction})
    residual = np.where(problem.mask, 0.001, 0.0)
    shapes = [*candidate.shapes(problem), *candidate.propose_shapes(resting, residual)]
    # Numbers that are no usual ones may be of a form of their own.
    shapes += [
        {**shape, name: sum(ends) / 2} for shape in shapes for name, ends in candidate.refinable(problem, shape).items()
    ]
    assert {candidate.form_of(shape) for shape in shapes} == set(candidate.forms or {""})


@pytest.mark.parametrize(
    ("name", "shape", "form"),
    [
        ("sensor-delay", {"late": "torque_Nm", "secant_s": 0.1}, "dead time"),
        ("sensor-delay", {"late": "torque_Nm", "filter_s": 0.1}, "first-order filter"),
        ("sensor-delay", {"late": "load_N", "input_secant_s": 0.1}, "dead time"),
        ("load-dependent-efficiency", {"power": 0.0}, "constant share"),
        ("stribeck-friction", {"exponent": 1.0}, "exponential"),
        ("stribeck-friction", {"exponent": 1.4}, "stretched exponential"),
        ("stribeck-friction", {"fades": "exponent 2"}, "Gaussian"),
        ("load-dependent-efficiency", {"power": 0.5}, "power of the torque"),
        ("load-dependent-efficiency", {"light": 0.5}, "exponential decay with the torque"),
        ("load-dependent-efficiency", {"bent": 0.0}, "linear efficiency"),
        ("bearing-drag", {"onset_s": 3.0, "rise_s": 0.0}, "step"),
        ("bearing-drag", {"onset_s": 3.0, "rise_s": 2.0}, "exponential rise"),
        ("bearing-drag", {"onset_s": 3.0, "full_at_s": 9.0, "power": 0.5}, "power of time"),
        ("turning-resistance", {"by": "angle"}, "over the slip angle"),
        ("slip-sinkage", {"power": 1.0}, "in proportion to slip"),
    ],
)
def test_a_shape_tells_the_form_of_its_law(name: str, shape: Shape, form: str) -> None:
    """The name that the answer gives belongs to the law that was fitted."""
    assert next(each for each in library() if each.name == name).form_of(shape) == form


def test_a_predicted_load_drifts_in_one_of_its_forms(problem: Problem) -> None:
    """Creep has an exponential rise, wear a power of time."""
    candidate = DriftOfPredictedLoad()
    assert {candidate.form_of(shape) for shape in candidate.shapes(problem)} == set(candidate.forms)


def test_a_delay_names_the_column_that_is_late() -> None:
    """The predicted one, or an input."""
    assert SensorDelay().words_for({"late": "valve_pct", "input_secant_s": 2.0}) == "a delay of valve_pct"
    assert SensorDelay().words_for({}) == SensorDelay.words
