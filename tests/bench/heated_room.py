"""A room with one heat capacity, whose heater is read with noise, for tests of what a state does with errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, SensorError, Simulation
from regolithd.calibration.mismatch.data.recording import Recording, from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS, STEP_s = 3000, 60.0
MEMORY_s = 3600.0
ERROR_A = 3.0
TRUE: dict[str, float] = {"warmth_K_A2": 0.04, "memory_s": MEMORY_s}


class Room(Simulation):
    """The temperature over that outside: it follows the square of the heater's current with a memory of an hour."""

    channel, unit = "room_degC", "degC"
    inputs = ("heater_A",)
    parameters: ClassVar = {"warmth_K_A2": Prior(0.04, 0.004, "K/A²"), "memory_s": Prior(MEMORY_s, 300.0, "s")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the temperature, integrated from 0."""
        return response(inputs["heater_A"][:, 0], values)[:, None]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the wind."""
        return {"wind": inputs["wind_m_s"]}


class ReadRoom(Room):
    """The same with a stated error of the current."""

    sensors: ClassVar = {"heater_A": SensorError(absolute=ERROR_A)}


def response(current: Array, values: Mapping[str, float], lost_K: Array | None = None) -> Array:
    """Return the temperature (time,); `lost_K` is what a draught takes from the settled one at each instant."""
    keeps = np.exp(-STEP_s / values["memory_s"])
    settled = values["warmth_K_A2"] * current**2 - (0.0 if lost_K is None else lost_K)
    found = np.zeros(len(current))
    for row in range(1, len(current)):
        found[row] = keeps * found[row - 1] + (1 - keeps) * settled[row - 1]
    return found


def recorded(seed: int, draught_K: float = 0.0, error_A: float = ERROR_A) -> Recording:
    """Return a recording; the draught is that at a wind of 5 m/s, proportional to what is above 1 m/s."""
    random = np.random.default_rng(seed)
    current = np.repeat(random.uniform(8, 20, ROWS // 50), 50)
    rows = np.arange(ROWS)
    wind = 3 + 2 * np.sin(rows / 40 + 1) * np.sin(rows / 170)
    true = response(current, TRUE, draught_K * np.maximum(wind - 1, 0) / 4)
    return from_columns(
        {
            "t_s": STEP_s * rows,
            "heater_A": current + error_A * random.normal(size=ROWS),
            "wind_m_s": wind,
            "room_degC": true + 0.3 * random.normal(size=ROWS),
        }
    )
