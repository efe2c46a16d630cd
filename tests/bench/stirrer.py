"""A stirrer: torque of the load by the square of the speed, whose bearings may drag by the speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, Simulation
from regolithd.calibration.mismatch.data.recording import Recording, from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LOAD, DRAG = 2.2e-7, 1.5e-5
"""True coefficient of the load, one of its stated standard deviations off, and the bearing's drag [N m s]."""
STEP_S, ROWS, NOISE_NM = 0.05, 12000, 0.006


class Stirrer(Simulation):
    """Torque on a shaft that turns one way, in a fluid whose load coefficient is known to ten percent."""

    channel = "torque_Nm"
    unit = "N m"
    inputs = ("speed_rad_s",)
    one_way = True
    parameters: ClassVar[dict[str, Prior]] = {"load_Nms2": Prior(2e-7, 2e-8, "N m s²")}

    def predict(self, inputs: Mapping[str, Array], parameters: Mapping[str, float]) -> Array:
        """Return the torque [N m]."""
        speed = inputs["speed_rad_s"]
        return parameters["load_Nms2"] * speed * abs(speed)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and time."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}


def stirred(seed: int, drag: float = DRAG, load: float = LOAD) -> Recording:
    """Return ten minutes of a stirrer between 120 and 480 rad/s."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)
    speed = 300 + 130 * np.sin(time_s / 9 + generator.uniform(0, 6)) + 50 * np.sin(time_s / 2.3)
    torque = load * speed**2 + drag * speed + generator.normal(0, NOISE_NM, ROWS)
    return from_columns({"t_s": time_s, "speed_rad_s": speed, "torque_Nm": torque})
