"""A blank input costs a stateful simulation the blank and what depends on it, not the rest of its run."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.inputs.autoregressive_truths import normal_truths
from regolithd.calibration.mismatch.problem.inputs.true_values import NoisyColumn, smooth_where_better, still_at_rest
from regolithd.calibration.mismatch.problem.simulated import inputs_of, simulated
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS, FORGETS_S = 2000, 20.0
TIME_S = np.arange(ROWS, dtype=np.float64)
POWER = 100 + 60 * np.sin(TIME_S / 30) + 20 * np.sign(np.sin(TIME_S / 71))


class Static(Simulation):
    """A reading in proportion to the power."""

    channel, unit = "reading_V", "V"
    inputs = ("power_W",)
    parameters: ClassVar = {"gain_V_W": Prior(0.05, 0.001, "V/W")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return gain times power."""
        return values["gain_V_W"] * inputs["power_W"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return power and time."""
        return {"power": inputs["power_W"], "time": inputs["t_s"]}


class Lagging(Static):
    """A reading that follows the power with a time constant, integrated as the user writes it: no care for blanks."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return gain times the low-passed power."""
        found = np.empty_like(inputs["power_W"])
        state = inputs["power_W"][0].copy()
        for row, power in enumerate(inputs["power_W"]):
            state = state + (power - state) / FORGETS_S
            found[row] = values["gain_V_W"] * state
        return found


def recorded(simulation: Simulation, blank: Array) -> Recording:
    """Return what the simulation predicts, with noise, and the power blank at some rows."""
    true = simulation.predict({"power_W": POWER[:, None]}, {"gain_V_W": 0.05})[:, 0]
    noise = np.random.default_rng(1).normal(0, 0.2, ROWS)
    return from_columns({"t_s": TIME_S, "reading_V": true + noise, "power_W": np.where(blank, np.nan, POWER)})


def rows(*places: slice | int) -> Array:
    """Return where these rows are."""
    found = np.zeros(ROWS, np.bool_)
    for place in places:
        found[place] = True
    return found


def test_a_single_blank_costs_one_reading() -> None:
    """With a state or without: the prediction goes on from the value between its neighbours."""
    blank = rows(3, 500, 1200)
    for simulation in (Static(), Lagging()):
        problem = build_problem(recorded(simulation, blank), simulation)
        np.testing.assert_array_equal(problem.mask[:, 0], ~blank)
        (left,) = problem.left_out
        assert (left.readings, left.reason) == (3, "power_W was not measured there")


def test_what_depends_on_a_long_blank_is_left_out_until_it_is_forgotten() -> None:
    """A state remembers the blank for a few time constants; a simulation without a state loses the blank alone."""
    blank = rows(slice(600, 700))
    without = build_problem(recorded(Static(), blank), Static())
    assert without.mask.sum() == ROWS - 100
    problem = build_problem(recorded(Lagging(), blank), Lagging())
    first = 700 + int(np.argmax(problem.mask[700:, 0]))
    assert 700 < first < 700 + 6 * FORGETS_S
    assert problem.mask[first:, 0].all()
    reasons = {left.reason: left.readings for left in problem.left_out}
    assert reasons["power_W was not measured there"] == 100
    assert reasons["the prediction depends on power_W where it was not measured"] == first - 700


def test_a_blank_does_not_cross_into_the_next_run() -> None:
    """The end of a run is held, and the next one begins anew."""
    recording = recorded(Static(), rows(slice(990, 1010)))
    columns = {"t_s": TIME_S % 1000, "run": np.floor(TIME_S / 1000)}
    columns |= {name: values[:, 0] for name, values in recording.channels.items()}
    problem = build_problem(from_columns(columns), Static())
    power = problem.recording.channels["power_W"][:, 0]
    np.testing.assert_array_equal(power[990:1000], POWER[989])
    np.testing.assert_array_equal(power[1000:1010], POWER[1010])


def test_a_column_that_is_to_stay_blank_does() -> None:
    """The simulation gets the NaN, and what it makes of it is its own affair."""

    class Own(Lagging):
        between_readings: ClassVar = {"power_W": "blank"}

    problem = build_problem(recorded(Own(), rows(1500)), Own())
    assert not problem.mask[1500:].any()


def test_a_stateful_simulation_with_blanks_is_consistent() -> None:
    """Two hundred scattered blanks and a long one make no physics."""
    scattered = np.random.default_rng(2).uniform(size=ROWS) < 0.1
    answer = compare(recorded(Lagging(), scattered | rows(slice(600, 650))), Lagging()).answer
    assert answer.verdict == "consistent"


class Winch(Static):
    """The same, with a speed that one of two noisy inputs is read as."""

    sensors: ClassVar = {"power_W": SensorError(absolute=2.0), "motor_rpm": SensorError(absolute=2.0)}

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the drum's speed, which stands while the motor is slow."""
        turns = np.where(inputs["motor_rpm"] > 10, inputs["motor_rpm"] / 20, 0.0)
        return {"wheel_speed": turns, "power": inputs["power_W"]}


def test_what_the_speed_is_computed_from_has_no_density() -> None:
    """Both columns have few levels: densities are used for the one that is no speed, a spline for both."""
    random = np.random.default_rng(2)
    power, rpm = (random.choice([0.0, 50.0, 90.0], ROWS // 20).repeat(20) + random.normal(0, 2, ROWS) for _ in "ab")
    recording = from_columns({"t_s": TIME_S, "reading_V": 0.05 * power, "power_W": power, "motor_rpm": rpm})
    found = simulated(inputs_of(recording, Winch()), Winch(), {"gain_V_W": 0.05}, THRESHOLDS).recording
    normal = normal_truths(np.column_stack((power, rpm)), np.full(2, 4.0), np.array([0]))
    splines = [
        smooth_where_better(NoisyColumn(each, 2.0, TIME_S, found.run, np.zeros(ROWS, np.bool_)), normal.column(k))
        for k, each in enumerate((power, rpm))
    ]
    rpm_alone = still_at_rest(rpm, 2.0, splines[1]).mean
    np.testing.assert_allclose(found.channels["motor_rpm"][:, 0], rpm_alone)
    assert np.std(found.channels["power_W"][:, 0] - splines[0].mean) > 0.1


def test_what_is_undefined_of_the_readings_is_not_compared() -> None:
    """At standstill, as the speed was read, though the smoothed speed still moves."""

    class Friction(Simulation):
        """A drive of which nothing is known at standstill."""

        channel, unit, inputs = "current_A", "A", ("speed_rad_s",)
        parameters: ClassVar = {"coulomb_A": Prior(1.0, 0.1, "A")}
        sensors: ClassVar = {"speed_rad_s": SensorError(absolute=0.2)}

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            """Return a current that has the sign of the speed."""
            sign = np.where(np.abs(inputs["speed_rad_s"]) < 0.1, np.nan, np.sign(inputs["speed_rad_s"]))
            return values["coulomb_A"] * sign

    random, count = np.random.default_rng(1), 600
    speed = np.sin(np.arange(count) / 15) + random.normal(0, 0.2, count)
    recording = from_columns({"t_s": np.arange(count) * 0.1, "speed_rad_s": speed, "current_A": np.sign(speed)})
    simulation = Friction()
    inputs = inputs_of(recording, simulation)
    assert np.any((np.abs(inputs.expected.channels["speed_rad_s"]) > 0.1) & (np.abs(speed) < 0.1)[:, None])
    run = simulated(inputs, simulation, {"coulomb_A": 1.0}, THRESHOLDS)
    assert np.isnan(run.prediction[np.abs(speed) < 0.1]).all()
