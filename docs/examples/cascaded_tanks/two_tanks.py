"""Two tanks, one above the other, with free outlets, fed by a pump: Torricelli's law, and no edge to overflow."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from overflow import Overflow

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Array, Candidate

STEPS = 2
"""Steps of the integration within one sampling time."""
EDGE_V = 10.0
"""Level at which a tank is full, as published: the sensor's largest reading."""


class TwoTanks(Simulation):
    """The lower tank's level, integrated from the pump's voltage: h₁' = −k₁ √h₁ + k₄ u, h₂' = k₂ √h₁ − k₃ √h₂."""

    channel, unit = "level_V", "V"
    inputs = ("pump_V",)
    covariate_labels: ClassVar = {"pump": "pump voltage (V)", "torque": "simulated level (V)"}
    parameters: Mapping[str, Prior] = {
        "k1": Prior(0.04, 0.02, "√V/s"),
        "k2": Prior(0.04, 0.02, "√V/s"),
        "k3": Prior(0.04, 0.02, "√V/s"),
        "k4": Prior(0.04, 0.02, "1/s"),
        "upper_start_V": Prior(5.0, 2.0, "V"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the lower tank's level [V], each run from its first reading."""
        return self._levels(inputs, values)[1]

    def _levels(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> tuple[Array, Array]:
        upper, lower = np.full((2, *inputs["t_s"].shape), np.nan)
        for run in np.unique(inputs["run"]):
            rows = np.flatnonzero(inputs["run"][:, 0] == run)
            times, pump = inputs["t_s"][rows, 0], inputs["pump_V"][rows, 0]
            levels = values["upper_start_V"], float(inputs["level_V"][rows[0], 0])
            for place, row in enumerate(rows):
                upper[row], lower[row] = levels
                if place + 1 < len(rows):
                    levels = self._step(levels, pump[place], times[place + 1] - times[place], values)
        return upper, lower

    def _step(
        self, levels: tuple[float, float], pump_V: float, step_s: float, values: Mapping[str, float]
    ) -> tuple[float, float]:
        """Return both levels one sampling time later (Euler)."""
        upper, lower = levels
        for _ in range(STEPS):
            out = np.sqrt(max(upper, 0.0))
            rise = (
                -values["k1"] * out + values["k4"] * pump_V,
                values["k2"] * out - values["k3"] * np.sqrt(max(lower, 0.0)),
            )
            upper, lower = (level + step_s / STEPS * rate for level, rate in ((upper, rise[0]), (lower, rise[1])))
            upper, lower = (level - values["overflow"] * max(level - EDGE_V, 0.0) for level in (upper, lower))
        return upper, lower

    def variants(self) -> dict[str, float]:
        """Return the switch for the overflow: the share of what rises above the edge that is lost."""
        return {"overflow": 0.0}

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the residual may depend on."""
        return {"time": inputs["t_s"], "pump": inputs["pump_V"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return what suits tanks: nothing turns in them."""
        return (*(c for c in library if c.name == "sensor-delay"), Overflow())
