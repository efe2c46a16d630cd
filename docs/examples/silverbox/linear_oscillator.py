"""The Silverbox, an electronic circuit that behaves as a mass on a spring with a damper: all of them linear."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from hardening_spring import HardeningSpring
from scipy.signal import butter, sosfiltfilt

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Array, Candidate, Recording

CUTOFF_HZ = 200.0
"""Low-pass of both voltages before differentiating, zero phase: the excitation ends at 200 Hz."""
EDGE_S = 0.03
"""Length at either end that the zero-phase filter distorts [s]."""


class LinearOscillator(Simulation):
    """The force (as a voltage) from the position (as a voltage): m ÿ + d ẏ + k y."""

    channel, unit = "force_V", "V"
    inputs = ("position_V", "speed_V_s", "acceleration_V_s2")
    covariate_labels: ClassVar = {
        "wheel_speed": "speed (V/s)",
        "wheel_acceleration": "acceleration (V/s²)",
        "position": "position (V)",
    }
    parameters: Mapping[str, Prior] = {
        "stiffness": Prior(1.0, 0.3, "V/V"),
        "damping_s": Prior(2.5e-4, 1e-4, "s"),
        "mass_s2": Prior(6e-6, 1e-6, "s²"),
    }

    def prepare(self, recording: Recording) -> Recording:
        """Low-pass both voltages, remove the input's offset, differentiate twice, and drop the ends."""
        step, time = recording.step_s, recording.time_s[:, None]
        low = butter(4, CUTOFF_HZ, fs=1 / step, output="sos")
        position = sosfiltfilt(low, recording.channel("output_V"), axis=0)
        force = sosfiltfilt(low, recording.channel("input_V"), axis=0)
        speed = np.gradient(position, step, axis=0)
        second = (np.roll(position, 1, axis=0) - 2 * position + np.roll(position, -1, axis=0)) / step**2
        whole = (time > time[0] + EDGE_S) & (time < time[-1] - EDGE_S)
        return recording.with_channels(
            force_V=np.where(whole, force - force.mean(), np.nan),
            position_V=position - position.mean(),
            speed_V_s=speed,
            acceleration_V_s2=second,
        )

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return m ÿ + d ẏ + k y [V]."""
        return (
            values["mass_s2"] * inputs["acceleration_V_s2"]
            + values["damping_s"] * inputs["speed_V_s"]
            + values["stiffness"] * inputs["position_V"]
        )

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the residual may depend on."""
        return {"time": inputs["t_s"], "wheel_speed": inputs["speed_V_s"], "position": inputs["position_V"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the library, and a spring that hardens; nothing turns here."""
        return (*(c for c in library if c.name != "wheel-angle-ripple"), HardeningSpring())
