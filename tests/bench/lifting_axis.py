"""An axis that lifts a load to and fro, for tests of whole comparisons: 5000 readings, with noise as a sensor has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

Array = NDArray[np.float64]

RATE_HZ, LENGTH_S = 10, 500


class LiftingAxis(Simulation):
    """A torque that holds the load and damps the motion."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("speed_rad_s", "load_N")
    parameters: ClassVar[Mapping[str, Prior]] = {"gain": Prior(1.0, 0.03, ""), "lever_m": Prior(0.02, 0.001, "m")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque."""
        return torque(inputs["speed_rad_s"], inputs["load_N"], values["gain"], values["lever_m"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, load and temperature."""
        names = {"wheel_speed": "speed_rad_s", "load": "load_N", "temperature": "oil_degC"}
        return {name: inputs[column] for name, column in names.items()}


def torque(speed: Array, load: Array, gain: float, lever: float) -> Array:
    """Return what the simulation predicts."""
    return gain * (lever * load * np.sign(speed) + 0.4 * speed)


def drive(
    seed: int,
    added: Callable[[dict[str, Array]], Array] | None = None,
    *,
    noise_time_s: float = 1.0,
    noise: float = 0.1,
) -> dict[str, Any]:
    """Return a recording, as columns.

    Parameters
    ----------
    added: what the simulation leaves out, of the columns
    noise_time_s: correlation time of half of the noise's variance; the other half is white
    noise: standard deviation over the mean reading
    """
    rng, count = np.random.default_rng(seed), RATE_HZ * LENGTH_S
    time, speed, at, now = np.arange(count) / RATE_HZ, np.zeros(count), 0, 0.0
    while at < count:
        hold, wanted = (
            int(rng.uniform(4, 15) * RATE_HZ),
            rng.choice([0, 1, 1, 1]) * rng.choice([-1, 1]) * rng.uniform(0.3, 3),
        )
        ramp = min(hold, 20, count - at)
        speed[at : at + ramp], speed[at + ramp : at + hold] = np.linspace(now, wanted, ramp), wanted
        now, at = wanted, at + hold
    load = np.repeat(rng.uniform(20, 120, LENGTH_S // 25), 25 * RATE_HZ)
    phases = rng.uniform(0, 2 * np.pi, 2)
    oil = 20 + 12 * np.sin(2 * np.pi * time / 280 + phases[0]) + 4 * np.sin(2 * np.pi * time / 97 + phases[1])
    columns = {"t_s": time, "speed_rad_s": speed, "load_N": load, "oil_degC": oil}
    true = torque(speed, load, 1 + 0.03 * rng.standard_normal(), 0.02 + 0.001 * rng.standard_normal())
    mean = float(np.abs(true).mean())
    kept = np.exp(-1 / RATE_HZ / noise_time_s)
    slow = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(3 * count))[-count:]
    wanders = noise * mean * np.sqrt(0.5) * (rng.standard_normal(count) + slow)
    left_out = 0.0 if added is None else added(columns)
    return {**columns, "torque_Nm": true + left_out + wanders}
