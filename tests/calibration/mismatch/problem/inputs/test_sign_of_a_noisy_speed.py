"""A cart whose class takes the sign of its recorded speed, and differentiates it, as one is written at first."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.inputs.input_doubt import InputDoubt, input_doubt
from regolithd.calibration.mismatch.problem.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
STEP_S, SPEED_STD, NOISE_A = 0.2, 0.12, 0.05
FRICTION_A, INERTIA_A_S2, DRAG_A_S = 1.2, 0.9, 0.05


class Cart(Simulation):
    """The current of a cart's motor: friction, a viscous drag, and what accelerates the cart."""

    channel, unit = "current_A", "A"
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {
        "friction_A": Prior(FRICTION_A, 0.03, "A"),
        "drag_A_s": Prior(DRAG_A_S, 0.005, "A s/rad"),
        "inertia_A_s2": Prior(INERTIA_A_S2, 0.03, "A s²/rad"),
    }
    sensors: ClassVar = {"speed_rad_s": SensorError(absolute=SPEED_STD)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        speed = inputs["speed_rad_s"]
        rate = np.gradient(speed, inputs["t_s"][:, 0], axis=0)
        moving = values["friction_A"] * np.sign(speed) + values["drag_A_s"] * speed + values["inertia_A_s2"] * rate
        return np.where(speed == 0, 0.0, moving)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


def smooth_step(share: Array) -> Array:
    """Return a step from 0 to 1 whose rate begins and ends smoothly."""
    at = np.clip(share, 0, 1)
    return at**3 * (10 - 15 * at + 6 * at**2)


def driven(seed: int, *, friction_A: float = FRICTION_A, until_start: bool = False) -> tuple[Recording, Array]:
    """Return drives to and fro with rests between, and the true speed; one may end three readings after a start."""
    random, ends = np.random.default_rng(seed), 2.0
    time, starts = STEP_S * np.arange(1200), list[float]()
    speed = np.zeros(len(time))
    while ends < time[-1]:
        size = random.uniform(3, 13) * random.choice([-1, 1])
        ramp, dwell = random.uniform(4, 9), random.uniform(6, 20)
        starts.append(ends)
        speed += size * (smooth_step((time - ends) / ramp) - smooth_step((time - ends - ramp - dwell) / ramp))
        ends += 2 * ramp + dwell + random.uniform(2, 6)
    speed[np.abs(speed) < 1e-9] = 0.0
    rate = np.gradient(speed, STEP_S)
    current = np.where(speed == 0, 0.0, friction_A * np.sign(speed) + DRAG_A_S * speed + INERTIA_A_S2 * rate)
    read = np.where(speed == 0, 0.0, speed + random.normal(0, SPEED_STD, len(time)))
    columns = {"t_s": time, "speed_rad_s": read, "current_A": current + random.normal(0, NOISE_A, len(time))}
    last = np.searchsorted(time, starts[-1]) + 4 if until_start else len(time)
    return from_columns({name: values[:last] for name, values in columns.items()}), speed[:last, None]


def test_nothing_is_found_where_nothing_is_missing() -> None:
    """In eleven of twelve: what smoothing leaves of a speed's error is slow in its rate, and as large as the noise."""
    answers = [compare(driven(seed)[0], Cart()).answer for seed in range(12)]
    assert sum(answer.verdict == "consistent" for answer in answers) >= 11
    assert all(each.prior_stds_away < 3 for answer in answers for each in answer.parameters)
    assert not any(answer.effects for answer in answers)


@pytest.mark.parametrize("seed", [4, 7])
def test_a_recording_may_end_as_a_motion_begins(seed: int) -> None:
    """Whose direction no reading tells: friction may have either sign."""
    answer = compare(driven(seed, until_start=True)[0], Cart()).answer
    assert answer.verdict == "consistent", answer.unexplained


@pytest.mark.parametrize("seed", [1, 2])
def test_friction_has_its_size(seed: int) -> None:
    """A quarter more than is stated, in the place of a parameter."""
    answer = compare(driven(seed, friction_A=1.25 * FRICTION_A)[0], Cart()).answer
    moved = {each.name: each.value for each in answer.parameters if each.prior_stds_away > 3}
    named = {each.name: next(iter(each.parameters.values())).value for each in answer.effects}
    assert not answer.unexplained
    assert moved == pytest.approx({"friction_A": 1.25 * FRICTION_A}, rel=0.03) or named == pytest.approx(
        {"coulomb-friction": 0.25 * FRICTION_A}, rel=0.1
    )


def doubt_of(recording: Recording) -> InputDoubt:
    """Return how uncertain the cart's prediction is."""
    doubt = inputs_of(recording, Cart()).doubt
    assert doubt is not None
    return doubt


def test_the_variance_is_that_of_a_smoothed_rate() -> None:
    """As large as the prediction is off, within a factor that the recording tells; independent errors have another."""
    recording, speed = driven(1)
    inputs, stated = inputs_of(recording, Cart()), {name: prior.value for name, prior in Cart.parameters.items()}
    clear = np.abs(speed) > 1
    of_truth = recording.with_channels(speed_rad_s=speed)
    off = [
        Cart().predict({**each.channels, "t_s": each.time_s[:, None]}, stated) for each in (inputs.expected, of_truth)
    ]
    variance = float(np.mean((off[0] - off[1])[clear] ** 2))
    doubt = doubt_of(recording)
    assert variance / 3 < float(np.mean(doubt.alone[clear])) < 1.5 * variance
    np.testing.assert_array_equal(doubt.alone[clear], doubt.together[clear])
    assert doubt.most > 1
    alike = input_doubt(inputs.as_read, inputs.expected, Cart(), stated, Cart.sensors)
    assert alike is not None
    assert alike.most == 1


def test_readings_of_no_known_direction_are_in_doubt_by_twice_the_friction() -> None:
    """Of probability a half; those at rest are in none."""
    recording, speed = driven(2, until_start=True)
    doubt = doubt_of(recording)
    last = np.flatnonzero(speed[:, 0])[-1]
    assert doubt.alone[last, 0] > 0.2 * (2 * FRICTION_A) ** 2
    rest = np.convolve(speed[:, 0] == 0, np.ones(5), "same") == 5
    assert float(np.max(doubt.alone[rest])) < NOISE_A**2
