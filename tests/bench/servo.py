"""A user's own simulation, as short as it may be: force = mass × acceleration, one axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray


class ServoAxis(Simulation):
    """A carriage on a screw."""

    channel = "force_N"
    unit = "N"
    wheel_column = "axis"
    inputs = ("acceleration_m_s2",)
    parameters: ClassVar = {"mass_kg": Prior(95.0, 2.0, "kg")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return Newton's second law."""
        return values["mass_kg"] * inputs["acceleration_m_s2"]

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return what friction follows."""
        return {"wheel_speed": inputs["speed_m_s"], "time": inputs["t_s"]}
