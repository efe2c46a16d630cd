"""A servo axis on a ball screw (EMPS): force = mass × acceleration, without friction."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from asymmetric_friction import AsymmetricFriction
from linear_friction import LinearFriction
from scipy.signal import butter, sosfiltfilt

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Array, Candidate, Recording

FORCE_PER_VOLT = 35.15
CUTOFF_HZ = 20.0
EDGE_S = 0.15
"""Length at either end that the zero-phase filter distorts [s]: three periods of its cutoff."""


class ServoAxis(Simulation):
    """The force at the carriage, from its acceleration alone."""

    channel, unit = "force_N", "N"
    inputs = ("acceleration_m_s2",)
    covariate_labels: ClassVar = {"wheel_speed": "carriage speed (m/s)", "position": "carriage position (m)"}
    parameters: Mapping[str, Prior] = {"mass_kg": Prior(95.0, 5.0, "kg")}

    def prepare(self, recording: Recording) -> Recording:
        """Low-pass position and voltage with zero phase, differentiate, and drop the ends."""
        step = recording.step_s
        low = butter(4, CUTOFF_HZ, fs=1 / step, output="sos")
        position = sosfiltfilt(low, recording.channel("position_m"), axis=0)
        force = FORCE_PER_VOLT * sosfiltfilt(low, recording.channel("motor_voltage_reference_V"), axis=0)
        speed = np.gradient(position, step, axis=0)
        time = recording.time_s[:, None]
        whole = (time > time[0] + EDGE_S) & (time < time[-1] - EDGE_S)
        return recording.with_channels(
            force_N=np.where(whole, force, np.nan),
            speed_m_s=speed,
            acceleration_m_s2=np.gradient(speed, step, axis=0),
        )

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return m a [N]."""
        return values["mass_kg"] * inputs["acceleration_m_s2"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the residual may depend on."""
        return {"time": inputs["t_s"], "wheel_speed": inputs["speed_m_s"], "position": inputs["position_m"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the library without what this machine cannot have, and two effects as its literature has them.

        A slide has no wheel angle. The voltage is the controller's command: no sensor with an offset measures it.
        """
        foreign = {"wheel-angle-ripple", "current-sensor-bias", "viscous-friction"}
        return (*(c for c in library if c.name not in foreign), LinearFriction(), AsymmetricFriction())
