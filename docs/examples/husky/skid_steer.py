"""A skid-steer Husky: each side's current depends on its own speed alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, Simulation
from regolithd.calibration.parameters import GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Array

CREEPING_M_S = 0.02
"""Rim speed below which a side counts as standing [m/s]."""


class SkidSteer(Simulation):
    """Current of the left (1) and right (2) motors; the controller reports its magnitude, without a sign."""

    channel, unit = "motor_current_A", "A"
    wheel_column = "wheel"
    inputs = ("rim_speed_m_s",)
    covariate_labels: ClassVar = {
        "wheel_speed": "rim speed (m/s)",
        "yaw_rate": "yaw rate (rad/s)",
        "pitch": "forward acceleration (g)",
        "torque": "predicted motor current (A)",
    }
    parameters: Mapping[str, Prior] = {
        "standing_A": Prior(2.0, 5.0, "A"),
        "per_speed_A_s_m": Prior(0.0, 20.0, "A s/m"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return a + b |v| [A] where the side turns."""
        speed = np.abs(inputs["rim_speed_m_s"])
        return np.where(speed > CREEPING_M_S, values["standing_A"] + values["per_speed_A_s_m"] * speed, np.nan)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed without its sign, as the current has none; the IMU's forward acceleration stands for a slope."""
        return {
            "time": inputs["t_s"],
            "wheel_speed": np.abs(inputs["rim_speed_m_s"]),
            "yaw_rate": inputs["yaw_rate_rad_s"],
            "pitch": inputs["forward_m_s2"] / GRAVITY_M_S2,
        }

    def side(self, wheels: Sequence[int]) -> Array | None:
        """Wheel 1 is the left side."""
        return np.array([-1.0 if wheel == 1 else 1.0 for wheel in wheels])
