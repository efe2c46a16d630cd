"""The search for a ripple needs memory in proportion to the readings, and finds it on a machine that turns fast."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from scipy.stats import chi2

from regolithd.calibration.mismatch import Simulation
from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.candidates.responses import strongest
from regolithd.calibration.mismatch.candidates.wheel_angle_ripple import FORMS, WheelAngleRipple
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.problem.problem import Problem

    Array = NDArray[np.float64]

ROWS = 2573
MEMORY_MB = 40
"""Most memory of the search (a choice): two thousand numbers for each reading."""


class Propeller(Simulation):
    """A thrust of 1 N."""

    channel, unit = "thrust_N", "N"
    inputs: ClassVar = ("speed_rad_s",)

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:  # noqa: ARG002
        """Return 1 N."""
        return np.ones_like(inputs["speed_rad_s"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and time."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}


def spun(fastest_rad_s: float, step_s: float, order: float) -> tuple[Problem, Array]:
    """Return the problem of a propeller that rests, spins up and rests, and a ripple of that order."""
    time_s = step_s * np.arange(ROWS)
    speed = fastest_rad_s * np.clip(np.sin(time_s * 2 * np.pi * 5 / time_s[-1]), 0, None)
    angle = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step_s)))
    columns = {"t_s": time_s, "thrust_N": np.ones(ROWS), "speed_rad_s": speed}
    problem = build_problem(from_columns(columns), Propeller())
    return problem, np.cos(order * angle)[:, None]


@pytest.mark.parametrize("fastest_rad_s", [100.0, 3000.0])
def test_a_fast_propeller_that_often_rests_takes_no_more_memory(fastest_rad_s: float) -> None:
    """The time at rest resolves no order, and turns that no reading resolves need no bins."""
    problem, ripple = spun(fastest_rad_s, 0.1, 1.0)
    tracemalloc.start()
    WheelAngleRipple().propose_shapes(problem, ripple)
    peak_MB = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    assert peak_MB < MEMORY_MB


@pytest.mark.parametrize("order", [2.0, 7.0])
def test_an_order_is_found_with_as_few_bins_as_the_readings_resolve(order: float) -> None:
    """To the width of its line."""
    problem, ripple = spun(20.0, 0.01, order)
    found = [float(shape["order"]) for shape in WheelAngleRipple().propose_shapes(problem, ripple)]
    assert any(each == pytest.approx(order, abs=0.02) for each in found)


def test_a_constant_at_a_speed_too_high_for_the_readings_is_no_ripple() -> None:
    """Most readings turn by a third between two of them: order 3.14 is an alias of a constant there."""
    time_s = 0.005 * np.arange(8000)
    speed = np.where(time_s < 12, 20.0, 400.0)
    columns = {"t_s": time_s, "thrust_N": np.ones(len(time_s)), "speed_rad_s": speed}
    problem = build_problem(from_columns(columns), Propeller())
    constant = np.where(speed > 20, 1.0, 0.0)[:, None]
    ripple = 0.2 * np.cos(7.0 * problem.covariates["wheel_angle"]) * (1 - constant)
    found = WheelAngleRipple().propose_shapes(problem, ripple + constant)
    assert 7.0 in {round(float(shape["order"]), 1) for shape in found}


def turning(speed: Array) -> Problem:
    """Return the problem of a propeller whose speed is read five times a second."""
    time_s = 0.2 * np.arange(len(speed))
    columns = {"t_s": time_s, "thrust_N": np.ones(len(time_s)), "speed_rad_s": speed}
    return build_problem(from_columns(columns), Propeller())


def orders_in(problem: Problem, residual: Array) -> set[float]:
    """Return the orders that the search proposes, to a tenth."""
    noise = 0.5 * np.random.default_rng(5).standard_normal(len(residual))
    found = WheelAngleRipple().propose_shapes(problem, (residual + noise)[:, None])
    return {round(float(shape["order"]), 1) for shape in found}


def test_a_ripple_that_turns_on_by_more_than_a_cycle_between_readings_is_found_at_several_speeds() -> None:
    """The angle tells its phase at each reading; no other order has the same phases at every speed."""
    time_s = 0.2 * np.arange(6000)
    problem = turning(7.0 + 1.5 * np.sin(2 * np.pi * time_s / 300))
    assert 5.0 in orders_in(problem, np.cos(5.0 * problem.covariates["wheel_angle"][:, 0]))


def test_a_late_channel_shows_an_earlier_angle_and_not_a_smaller_ripple() -> None:
    """A straight line between waves that are more than a cycle apart is no wave."""
    time_s, delay_s = 0.2 * np.arange(6000), 0.27
    problem = turning(7.0 + 1.5 * np.sin(2 * np.pi * time_s / 300))
    angle = problem.covariates["wheel_angle"][:, 0]
    expected = np.cos(5.0 * np.interp(time_s - delay_s, time_s, angle))
    late = replace(problem, late=("secant_s", delay_s))
    shape = {"order": 5.0, "kind": "torque", "sines": 1.0}
    np.testing.assert_allclose(columns_of(late, WheelAngleRipple(), shape)[0, :, 0], expected, atol=1e-6)
    assert 5.0 in orders_in(late, expected)


@pytest.mark.parametrize(("lag", "told"), [(0.15, 0.15), (-0.4, -0.4), (0.01, 0.0)])
def test_an_angle_that_lags_by_a_part_of_a_reading_is_found_so(lag: float, told: float) -> None:
    """To a sixteenth of a reading; what noise hides is none."""
    time_s = 0.2 * np.arange(6000)
    problem = turning(7.0 * np.sin(2 * np.pi * time_s / 300))
    angle = problem.covariates["wheel_angle"][:, 0] - lag * 0.2 * problem.covariates["wheel_speed"][:, 0]
    noise = 0.5 * np.random.default_rng(5).standard_normal(len(angle))
    proposed = WheelAngleRipple().propose_shapes(problem, (np.cos(2 * angle) + noise)[:, None])
    found = [float(shape["lag"]) for shape in proposed if shape["kind"] == "torque" and abs(shape["order"] - 2) < 0.1]
    assert found
    assert found == pytest.approx([told] * len(found), abs=0.07)


def test_a_ripple_that_stops_with_the_motion_is_told_from_one_that_does_not() -> None:
    """Where the recording has rests; without any both are the same, and none of them is asked for."""
    time_s = 0.2 * np.arange(6000)
    problem = turning(7.0 * np.clip(np.sin(2 * np.pi * time_s / 300), 0.0, None))
    shape = {"order": 2.0, "kind": "turning", "sines": 1.0}
    at_rest = problem.covariates["direction"][:, 0] == 0
    waves = columns_of(problem, WheelAngleRipple(), shape)[:, :, 0]
    assert np.all(waves[:, at_rest] == 0)
    always = columns_of(problem, WheelAngleRipple(), {**shape, "kind": "torque"})[:, :, 0]
    np.testing.assert_array_equal(waves[:, ~at_rest], always[:, ~at_rest])
    assert {kind for kind in FORMS if kind in kinds_proposed(problem)} == set(FORMS)
    assert "turning" not in kinds_proposed(turning(7.0 + np.sin(2 * np.pi * time_s / 300)))


def kinds_proposed(problem: Problem) -> set[str]:
    """Return what the sines that are proposed are a factor of."""
    residual = np.cos(2 * problem.covariates["wheel_angle"])
    return {str(shape["kind"]) for shape in WheelAngleRipple().propose_shapes(problem, residual)}


def test_at_one_speed_its_order_is_not_known() -> None:
    """Orders 5 and 5 − 2π/1.4 have the same phases at each reading of 7 rad/s."""
    problem = turning(np.full(6000, 7.0))
    assert 5.0 not in orders_in(problem, np.cos(5.0 * problem.covariates["wheel_angle"][:, 0]))


def test_what_is_slow_is_no_ripple_that_turns_on_between_readings() -> None:
    """At 7 rad/s a constant and a drift have the phases of order 2π/1.4 = 4.5, as noise has of any."""
    time_s = 0.2 * np.arange(6000)
    problem = turning(np.where(time_s < 900, 7.0, 6.0))
    resolved = 1 / (2.5 * 7.0 * 0.2 / (2 * np.pi))
    assert all(order <= resolved + 0.2 for order in orders_in(problem, 2.0 + time_s / 300))


@pytest.mark.parametrize("wheels", [1, 4])
def test_white_noise_has_an_autocorrelation_time_of_one(wheels: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The power of white noise, summed over the wheels, has the median of χ² with two degrees of freedom a wheel."""
    candidate, order = WheelAngleRipple(), np.linspace(0.0, 20.0, 2001)
    power = np.full(order.shape, 0.5 * chi2.median(2 * wheels))
    monkeypatch.setattr(candidate, "_spectrum", lambda *_: (order, power))
    speed = np.ones((10, wheels))
    problem = SimpleNamespace(mask=speed > 0, known=lambda _: speed, recording=SimpleNamespace(step_s=0.01))
    assert candidate._autocorrelation_time(problem, power, 10.0) == pytest.approx(1.0, rel=0.02)


def test_the_amplitude_is_that_of_the_wheels_that_have_it() -> None:
    """One of three wheels has it: the others have coefficients of 0, or what draws add to these."""
    shape = {"order": 3.0, "sines": 1.0}
    found = WheelAngleRipple().parameters(shape, [3.0, 4.0, 0.0, 0.0, 1e-9, -1e-9])
    assert found["amplitude"] == pytest.approx(5.0)
    assert WheelAngleRipple().parameters(shape, [3.0, 4.0, 0.0, 5.0])["amplitude"] == pytest.approx(5.0)
    assert WheelAngleRipple().parameters(shape, [0.0, 0.0])["amplitude"] == 0.0


class Geared(Propeller):
    """The same with an angle that was recorded."""

    inputs: ClassVar = ("speed_rad_s", "angle_rad")

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, time and angle."""
        return {**super().covariates(inputs), "wheel_angle": inputs["angle_rad"]}


def turned(begin_rad: float, order: float, amplitude: float) -> tuple[Problem, Array]:
    """Return the problem of a propeller with an encoder, and a ripple of that order in noise."""
    time_s = 0.02 * np.arange(4000)
    speed = 5.0 + 2.0 * np.sin(0.7 * time_s)
    angle = begin_rad + np.cumsum(speed) * 0.02
    columns = {"t_s": time_s, "thrust_N": np.ones(len(time_s)), "speed_rad_s": speed, "angle_rad": angle}
    residual = amplitude * np.cos(order * angle) + np.random.default_rng(int(10 * begin_rad)).normal(0, 0.5, len(angle))
    return build_problem(from_columns(columns), Geared()), residual[:, None]


def test_recordings_that_show_no_ripple_by_themselves_respond_to_one_together() -> None:
    """Of a whole order the phase is the same in all, wherever the angle begins; where it is not recorded, none is."""
    candidate = WheelAngleRipple()
    found = [candidate.responses(*turned(begin, 3.0, 0.04)) for begin in (0.0, 0.4, 1.7, 2.9, 4.6, 5.1)]
    assert None not in found
    shapes = found[0].shapes[strongest(found, ["a"] * len(found), 1)[0]]
    assert [(shape["order"], shape["sines"]) for shape in shapes] == [(3.0, 1.0), (3.0, 2.0)]
    problem, ripple = spun(20.0, 0.01, 3.0)
    assert candidate.responses(problem, ripple) is None


def test_a_response_has_the_gain_that_noise_leaves() -> None:
    """Δχ² of cosine and sine over the noise around the order: of white noise its variance."""
    found = WheelAngleRipple().responses(*turned(0.3, 3.0, 0.1)) or pytest.fail("no response")
    (place,) = [n for n, (first, _) in enumerate(found.shapes) if (first["order"], first["kind"]) == (3.0, "torque")]
    gain = float(np.sum(found.moment[place, 0] ** 2) / found.energy[place, 0])
    assert gain == pytest.approx(0.1**2 / 2 * 4000 / 0.25, rel=0.5)


def test_each_wheel_has_its_own_columns() -> None:
    """Their places are those of its cosine and sine, then of its overtone."""
    problem, _ = turned(0.0, 3.0, 0.0)
    shape = {"order": 3.0, "kind": "torque", "sines": 2.0}
    assert WheelAngleRipple().columns_of_wheels(shape, 3).tolist() == [[0, 1, 6, 7], [2, 3, 8, 9], [4, 5, 10, 11]]
    assert len(WheelAngleRipple().columns(problem, shape)) == WheelAngleRipple().columns_of_wheels(shape, 1).size
