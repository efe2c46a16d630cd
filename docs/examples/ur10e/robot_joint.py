"""A joint of a robot arm (UR10e) that moves alone: motor current from inertia and gravity, without friction."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.signal import butter, sosfiltfilt

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Array, Candidate, Recording

CUTOFF_HZ = 5.0
"""Low-pass of the speed before it is differentiated, zero phase: the profiles have no faster motion."""


class RobotJoint(Simulation):
    """Current of one joint: inertia × acceleration, and the weight of what it carries."""

    channel, unit = "motor_current_A", "A"
    inputs = ("acceleration_rad_s2", "angle_rad")
    covariate_labels: ClassVar = {
        "wheel_speed": "joint speed (rad/s)",
        "wheel_acceleration": "joint acceleration (rad/s²)",
        "wheel_angle": "joint angle (rad)",
        "angle": "joint angle (rad)",
    }
    parameters: Mapping[str, Prior] = {
        "inertia_A_s2_per_rad": Prior(0.5, 1.0, "A s²/rad"),
        "gravity_sine_A": Prior(0.0, 6.0, "A"),
        "gravity_cosine_A": Prior(0.0, 6.0, "A"),
    }

    def prepare(self, recording: Recording) -> Recording:
        """Low-pass the speed and differentiate it."""
        low = butter(2, CUTOFF_HZ, fs=1 / recording.step_s, output="sos")
        smooth = sosfiltfilt(low, recording.channel("speed_rad_s"), axis=0)
        return recording.with_channels(acceleration_rad_s2=np.gradient(smooth, recording.time_s, axis=0))

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current [A]."""
        angle = inputs["angle_rad"]
        weight = values["gravity_sine_A"] * np.sin(angle) + values["gravity_cosine_A"] * np.cos(angle)
        return values["inertia_A_s2_per_rad"] * inputs["acceleration_rad_s2"] + weight

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the residual may depend on."""
        return {"time": inputs["t_s"], "wheel_speed": inputs["speed_rad_s"], "angle": inputs["angle_rad"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the library without what this machine cannot have: the joint turns less than once, slowly, in air."""
        return tuple(c for c in library if c.name not in {"wheel-angle-ripple", "quadratic-drag"})
