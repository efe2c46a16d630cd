"""A winch whose current is in proportion to the pull: a small machine with several axes, for the mismatch tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]


class Winch(Simulation):
    """Current of a winch with some drums: in proportion to the pull."""

    channel, unit, wheel_column = "current_A", "A", "drum"
    inputs = ("pull_N", "speed")
    parameters: ClassVar = {"gain_A_N": Prior(0.02, 0.0004, "A/N")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current that the pull needs."""
        return values["gain_A_N"] * inputs["pull_N"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and time."""
        return {"wheel_speed": inputs["speed"], "time": inputs["t_s"]}
