"""Recordings of one axis that carries a load, with noise of which half wanders, and one concealed effect or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]
Effect = Callable[[Array, Array, Array], Array]
"""From time over the recording's length (0 to 1), speed [rad/s] and temperature [°C]: what acts, of any size."""

RATE_HZ, LENGTH_S = 10.0, 500.0
NOISE = 0.1
"""Standard deviation of the noise in mean readings; half of its variance is white, half first-order."""
SIZE = 0.04
"""Root mean square of an effect in mean readings."""
EFFECTS: Mapping[str, Effect] = {
    "slow wave": lambda share, _, __: np.sin(2 * np.pi * 2.3 * share + 1),
    "curve over the temperature": lambda _, __, celsius: np.exp(-0.5 * ((celsius - 25) / 5) ** 2),
    "cold lubricant": lambda _, speed, celsius: np.sign(speed) * np.exp(-(celsius - 20) / 12),
    "drag from a time on": lambda share, speed, _: np.sign(speed) * (share > 0.55),
    "Coulomb friction": lambda _, speed, __: np.sign(speed),
}
NAMES = {
    "cold lubricant": "cold-lubricant-friction",
    "drag from a time on": "bearing-drag",
    "Coulomb friction": "coulomb-friction",
}
"""What those effects are called that have a name; the others are unexplained."""
PRIORS = {"gain": Prior(1.0, 0.03, ""), "lever": Prior(0.02, 0.001, "m")}


class Axis(Simulation):
    """The torque of an axis that carries a load against friction in proportion to it, and turns a fan."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("speed_rad_s", "load_N")
    parameters = PRIORS

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque [N·m]."""
        speed = inputs["speed_rad_s"]
        return values["gain"] * (values["lever"] * inputs["load_N"] * np.sign(speed) + 0.4 * speed)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, load and temperature."""
        return {"wheel_speed": inputs["speed_rad_s"], "load": inputs["load_N"], "temperature": inputs["temp_degC"]}


def recording(seed: int, correlation_s: float, effect: str = "") -> Recording:
    """Return a recording whose slow noise has this correlation time, with an effect of `EFFECTS`."""
    rng = np.random.default_rng([seed, round(1000 * correlation_s)])
    time_s = np.arange(0, LENGTH_S, 1 / RATE_HZ, dtype=np.float64)
    speed = _speed(rng, len(time_s))
    load = np.repeat(rng.uniform(20, 120, 1 + int(LENGTH_S / 25)), int(25 * RATE_HZ))[: len(time_s)]
    period, phases = LENGTH_S / 1.7 * rng.uniform(0.7, 1.3), rng.uniform(0, 2 * np.pi, 2)
    angle = 2 * np.pi * time_s / period
    celsius = 20 + 15 * (np.sin(angle + phases[0]) + 0.4 * np.sin(2.7 * angle + phases[1]))
    truth = {"gain": 1 + 0.03 * rng.standard_normal(), "lever": 0.02 + 0.001 * rng.standard_normal()}
    torque = Axis().predict({"speed_rad_s": speed, "load_N": load}, truth)
    mean = float(np.abs(torque).mean())
    if effect:
        acting = EFFECTS[effect](np.asarray(time_s / LENGTH_S, np.float64), speed, celsius)
        torque = torque + SIZE * mean * acting / np.sqrt(np.mean(acting**2))
    noise = rng.standard_normal(len(time_s)) + _wandering(rng, len(time_s), correlation_s)
    torque = torque + NOISE * mean * np.sqrt(0.5) * noise
    columns = {"t_s": time_s, "speed_rad_s": speed, "load_N": load, "temp_degC": celsius, "torque_Nm": torque}
    return from_columns(columns, unit="axis")


def _speed(rng: np.random.Generator, count: int) -> Array:
    """Return ramps of 2 s and dwells, 0 in a quarter of them, both ways, shape (time,) [rad/s]."""
    speed, at, now = np.zeros(count), 0, 0.0
    while at < count:
        end = min(at + int(rng.uniform(4, 15) * RATE_HZ), count)
        then = rng.choice([0, 1, 1, 1]) * rng.choice([-1, 1]) * rng.uniform(0.3, 3)
        ramp = min(end - at, int(2 * RATE_HZ))
        speed[at : at + ramp], speed[at + ramp : end] = np.linspace(now, then, ramp), then
        at, now = end, then
    return speed


def _wandering(rng: np.random.Generator, count: int, correlation_s: float) -> Array:
    """Return first-order noise of variance 1, shape (time,)."""
    kept = np.exp(-1 / RATE_HZ / correlation_s)
    before = int(20 * correlation_s * RATE_HZ)
    driven = np.sqrt(1 - kept**2) * rng.standard_normal((before + count, 1))
    return recursion(np.full(driven.shape, kept), driven)[-count:, 0]
