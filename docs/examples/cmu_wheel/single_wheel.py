"""A single wheel in a sand bin: traction from slip, as measured without a slip angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from side_forces import CANDIDATES, sideways

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Array, Candidate, Recording

LONGITUDINAL = 1
SLIP = np.array([-1.0, -0.7, -0.5, -0.2, 0.0, 0.23, 0.5, 0.75, 0.9])
TRACTION = np.array([-2.0, -1.13, -0.74, -0.31, -0.055, 0.028, 0.04, 0.035, 0.057])
"""Longitudinal force over load against slip, from the 27 trials straight ahead."""


class SingleWheel(Simulation):
    """Longitudinal (axis 1) and lateral (axis 2) force; without a slip angle there is no lateral force."""

    channel, unit = "force_N", "N"
    wheel_column = "axis"
    inputs = ("load_N", "slip")
    covariate_labels: ClassVar = {
        "slip_angle": "slip angle (rad)",
        "sinkage": "sinkage (mm)",
        "load": "load (N)",
        "sideways": "lateral part of the sliding direction",
    }
    parameters: Mapping[str, Prior] = {"scale": Prior(1.0, 0.1)}

    def prepare(self, recording: Recording) -> Recording:
        """Add the number of the axis that a value belongs to."""
        axis = np.broadcast_to(np.asarray(recording.wheels, np.float64), recording.shape)
        return recording.with_channels(axis_number=axis)

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return load × traction(slip) along the wheel, and 0 across it [N]."""
        along = values["scale"] * inputs["load_N"] * np.interp(inputs["slip"], SLIP, TRACTION)
        return np.where(inputs["axis_number"] == LONGITUDINAL, along, 0.0)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the residual may depend on."""
        angle = np.radians(inputs["slip_angle_deg"])
        names = {"load": "load_N", "sinkage": "sinkage_mm", "slip": "slip"}
        side = sideways(inputs["travel_mm_s"], inputs["rim_mm_s"], angle)
        return {**{name: inputs[column] for name, column in names.items()}, "slip_angle": angle, "sideways": side}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:  # noqa: ARG002  # a rover's
        """Return the four lateral effects: a measured force has no drivetrain."""
        return CANDIDATES
