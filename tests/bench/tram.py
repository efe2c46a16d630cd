"""A tram uphill: a simulation whose grade comes from a slow barometer, and recordings of its current."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation
from regolithd.calibration.mismatch.data.recording import Recording, from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
COUNT, DELAY_S = 3000, 7.0


class Tram(Simulation):
    """The current of a drive uphill, whose grade comes from a slow barometer."""

    channel, unit = "current_A", "A"
    inputs = ("speed_m_s", "grade")
    one_way = True
    parameters: ClassVar = {
        "weight": Prior(30.0, 1.5, "A s/m"),
        "rolling": Prior(0.02, 0.002, "1"),
        "idle_A": Prior(0.5, 0.03, "A"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return what weight, rolling resistance and electronics take."""
        slope = values["rolling"] + inputs["grade"]
        return values["idle_A"] + values["weight"] * slope * inputs["speed_m_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and grade."""
        return {"wheel_speed": inputs["speed_m_s"], "pitch": inputs["grade"]}


def columns(seed: int, delay_s: float = DELAY_S, drag: float = 0.0) -> dict[str, Array]:
    """Return a drive over hills of which the grade is read late, and the current with quadratic drag."""
    random, t_s = np.random.default_rng(seed), np.arange(COUNT, dtype=np.float64)
    parts = [(random.uniform(0.004, 0.03), random.uniform(0, 6)) for _ in range(8)]
    speed = 3 + sum(0.7 * np.sin(2 * np.pi * f * t_s + phase) for f, phase in parts[:4])
    hills = [(f, phase + 1) for f, phase in parts]

    def grade(at: Array) -> Array:
        return sum((0.012 * np.sin(2 * np.pi * f * at + phase) for f, phase in hills), np.zeros(COUNT))

    current = 0.47 + 30.6 * (0.0193 + grade(t_s)) * speed + drag * speed**2
    noise = 0.25 * random.normal(size=COUNT)
    return {"t_s": t_s, "speed_m_s": speed, "grade": grade(t_s - delay_s), "current_A": current + noise}


def driven(seed: int, delay_s: float = DELAY_S, drag: float = 0.0) -> Recording:
    """Return them as a recording."""
    return from_columns(columns(seed, delay_s, drag))
