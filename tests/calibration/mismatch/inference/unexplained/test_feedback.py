"""A controller that acts on the predicted reading passes its noise on, and that is no physics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.inference.unexplained.feedback import notes_of_feedback
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
COUNT, STEP_S, NOISE_K = 1500, 5.0, 0.35


class Chamber(Simulation):
    """The temperature of a chamber that a heater warms: a state."""

    channel, unit = "temperature_degC", "degC"
    inputs = ("duty_pct", "outside_degC")
    parameters: ClassVar = {
        "power_W": Prior(900.0, 20.0, "W"),
        "loss_W_K": Prior(14.0, 0.4, "W/K"),
        "capacity_J_K": Prior(30000.0, 900.0, "J/K"),
        "start_degC": Prior(20.0, 0.5, "degC"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the temperature by explicit steps."""
        duty, outside = inputs["duty_pct"], inputs["outside_degC"]
        rate = STEP_S / values["capacity_J_K"]
        kept = 1 - rate * values["loss_W_K"]
        gained = rate * (values["power_W"] * duty / 100 + values["loss_W_K"] * outside)
        steps = np.concatenate([np.full((1, *duty.shape[1:]), values["start_degC"]), gained[:-1]])
        return np.asarray(lfilter([1.0], [1.0, -kept], steps, axis=0))

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the controller sets, and the temperature outside."""
        return {"duty": inputs["duty_pct"], "outside": inputs["outside_degC"]}


def heated(seed: int, acts_on_noise: float, offset_K: float = 0.0, memory: float = 0.0) -> Recording:
    """Return a recording of a controller that acts on a share of the reading's noise, which may have a memory.

    The reading is off by `offset_K` at full duty, by its square: a supply that sags, say.
    """
    random, t_s = np.random.default_rng(seed), STEP_S * np.arange(COUNT)
    wanted = np.repeat(random.uniform(30, 60, COUNT // 250), 250)
    outside = 15 + 4 * np.sin(t_s / 2500 + random.uniform(0, 6))
    noise, state, total = NOISE_K * random.normal(size=COUNT), 20.2, 0.0
    for k in range(1, COUNT):
        noise[k] += memory * noise[k - 1]
    duty, measured = np.zeros(COUNT), np.zeros(COUNT)
    for k in range(COUNT):
        error = wanted[k] - state - acts_on_noise * noise[k]
        total = float(np.clip(total + 0.02 * error, 0, 100))
        duty[k] = np.clip(4 * error + total, 0, 100)
        measured[k] = state + noise[k] + offset_K * (duty[k] / 100) ** 2
        state += STEP_S * (9.1 * duty[k] - 14.2 * (state - outside[k])) / 30300
    return from_columns({"t_s": t_s, "duty_pct": duty, "outside_degC": outside, "temperature_degC": measured})


@pytest.mark.parametrize(("seed", "memory"), [(0, 0.0), (3, 0.0), (1, 0.6)])
def test_a_controller_that_acts_on_the_noise_is_no_physics(seed: int, memory: float) -> None:
    """The residual follows the duty in what its past does not predict, though noise may remember some readings."""
    found = compare(heated(seed, acts_on_noise=1.0, memory=memory), Chamber()).answer
    assert found.verdict == "consistent"
    assert found.unexplained == ()
    assert compare(heated(seed, acts_on_noise=0.0, memory=memory), Chamber()).answer.verdict == "consistent"


def test_the_note_says_what_cannot_be_told_apart() -> None:
    """It names the covariate and the reading, and what to record instead."""
    notes = [compare(heated(seed, acts_on_noise=1.0), Chamber()).answer.notes for seed in range(4)]
    (told, *_) = [note for each in notes for note in each if "controller" in note]
    assert told.startswith("Duty follows the noise of the reading of temperature_degC")
    assert "record another sensor" in told


def test_an_input_that_has_an_error_is_told_as_no_controller() -> None:
    """What was smoothed for its error follows the noise that this error adds."""
    recording = heated(0, acts_on_noise=0.0)
    problem = replace(build_problem(recording, Chamber()), fed_back=frozenset({"duty"}))
    (of_controller,) = notes_of_feedback(problem)
    (of_input,) = notes_of_feedback(replace(problem, smoothed={"duty_pct": recording.channels["duty_pct"]}))
    assert "controller" in of_controller
    assert "own error" in of_input
    assert "controller" not in of_input


def quickly_heated(seed: int) -> Recording:
    """Return a recording of a quick controller, of which half of the noise lasts for a minute."""
    random, t_s = np.random.default_rng(seed), STEP_S * np.arange(COUNT)
    wanted = np.repeat(random.uniform(30, 60, COUNT // 250), 250)
    outside = 15 + 4 * np.sin(t_s / 2500 + random.uniform(0, 6))
    lasting = lfilter([np.sqrt(1 - 0.93**2)], [1.0, -0.93], random.normal(size=COUNT))
    noise = NOISE_K * (random.normal(size=COUNT) + lasting) / np.sqrt(2)
    duty, measured, state, total = np.zeros(COUNT), np.zeros(COUNT), 20.2, 0.0
    for k in range(COUNT):
        error = wanted[k] - state - noise[k]
        total = float(np.clip(total + 0.02 * error, 0, 100))
        duty[k] = np.clip(40 * error + total, 0, 100)
        measured[k] = state + noise[k]
        state += STEP_S * (9.1 * duty[k] - 14.2 * (state - outside[k])) / 30300
    return from_columns({"t_s": t_s, "duty_pct": duty, "outside_degC": outside, "temperature_degC": measured})


@pytest.mark.parametrize("seed", [2, 3, 6])
def test_noise_that_lasts_is_fed_back_as_long(seed: int) -> None:
    """A few steps of the set point are all that the duty's past predicts: the noise tells what the duty does next."""
    found = compare(quickly_heated(seed), Chamber()).answer
    assert found.verdict == "consistent"
    assert [note for note in found.notes if "controller" in note]


@pytest.mark.parametrize("acts_on_noise", [0.0, 0.3])
def test_what_follows_the_duty_itself_stays_unexplained(acts_on_noise: float) -> None:
    """An offset by the duty's square is followed by its past as well as by what is new."""
    for seed in range(3):
        found = compare(heated(seed, acts_on_noise, offset_K=2.0), Chamber()).answer
        assert found.verdict == "unexplained"
        assert "duty" in {place.covariate for place in found.unexplained}


class Cart(Simulation):
    """The current of a cart that goes to and fro: its idle current and rolling resistance take up any constant drag."""

    channel, unit = "current_A", "A"
    inputs = ("speed_rad_s", "load_N")
    parameters: ClassVar = {
        "idle_A": Prior(0.30, 0.03, "A"),
        "rolling_A_N": Prior(0.004, 0.0004, "A/N"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the drag against the motion."""
        drag = values["idle_A"] + values["rolling_A_N"] * inputs["load_N"]
        return drag * np.sign(inputs["speed_rad_s"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, load and roll."""
        return {"wheel_speed": inputs["speed_rad_s"], "load": inputs["load_N"], "roll": inputs["roll_rad"]}


def rolling(seed: int) -> Recording:
    """Return a recording of a cart whose drag grows with the square of its roll, which nobody controls."""
    random, count = np.random.default_rng(seed), 1600
    shocks, noise, way = random.normal(size=(2, count)), 0.2 * random.normal(size=count), np.zeros(count)
    slow = np.zeros((2, count))
    for k in range(1, count):
        slow[:, k] = 0.9 * slow[:, k - 1] + np.sqrt(1 - 0.9**2) * shocks[:, k]
        noise[k] += 0.5 * noise[k - 1]
    way[:] = np.where(np.arange(count) % 400 < 300, 1.0, -1.0)
    roll, load = 0.05 * slow[0], 100 + 10 * slow[1]
    current = (0.31 + 0.0041 * load + 40 * roll**2) * way + noise
    columns = {"t_s": 1.0 * np.arange(count), "speed_rad_s": 3 * way, "load_N": load, "roll_rad": roll}
    return from_columns({**columns, "current_A": current})


@pytest.mark.parametrize("seed", range(3))
def test_what_parameters_take_up_of_a_curve_is_no_sign_of_feedback(seed: int) -> None:
    """A drag by the roll is there in what the roll's past predicts too, less what idle current and resistance hold."""
    found = compare(rolling(seed), Cart()).answer
    assert "roll" in {place.covariate for place in found.unexplained}
    assert not [note for note in found.notes if "controller" in note]


class Supply(Simulation):
    """The voltage of a motor: what its speed induces, and what its current loses."""

    channel, unit = "voltage_V", "V"
    inputs = ("speed_rad_s", "current_A")
    parameters: ClassVar = {
        "constant_V_s": Prior(0.5, 0.005, "V s/rad"),
        "resistance_Ohm": Prior(0.8, 0.03, "Ω"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the sum of both."""
        return values["constant_V_s"] * inputs["speed_rad_s"] + values["resistance_Ohm"] * inputs["current_A"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the humidity."""
        return {"humidity": inputs["humidity_pct"]}


def test_a_slow_quantity_of_which_the_noise_is_quick_is_no_feedback() -> None:
    """A sine over the humidity, which a smooth curve follows too little where it is quick: a slope above 1 there."""
    random, time = np.random.default_rng(1), 0.025 * np.arange(3000)
    speed = 25 * np.sin(2 * np.pi * time / 1.7) * (1 + 0.4 * np.sin(time / 9))
    humidity = 60 + 20 * np.sin(2 * np.pi * time / 31) + 9 * np.sin(2 * np.pi * time / 17 + 1)
    current = 2 + 0.5 * np.sin(time / 3) + random.normal(0, 0.03, len(time))
    voltage = 0.5 * speed + 0.8 * current + 1.7 * np.sin(2 * np.pi * humidity / 32)
    columns = {
        "t_s": time,
        "speed_rad_s": speed,
        "current_A": current,
        "humidity_pct": humidity + random.normal(0, 0.02, len(time)),
        "voltage_V": voltage + random.normal(0, 0.2, len(time)),
    }
    found = compare(from_columns(columns), Supply()).answer
    assert [place.covariate for place in found.unexplained] == ["humidity"]
