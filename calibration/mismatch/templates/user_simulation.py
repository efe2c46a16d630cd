"""A simulation to start from: the torque of a joint from its acceleration and speed. Change names, inputs and law."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Joint(Simulation):
    """Inertia and viscous friction of one joint.

    What else a class may state (several channels, errors and slower sensors of inputs, states, machines that run one
    way or stand, effects of its own): docs/how-to/simulation.md, or
    python -m pydoc regolithd.calibration.mismatch.Simulation.
    What is looked for with it: regolithd mismatch --effects --simulation SIM.toml.
    """

    channel, unit = "torque_Nm", "N·m"  # the recorded column that is predicted
    wheel_column = "axis"  # the column that tells several axes apart; a recording without it has one
    inputs = ("acceleration_rad_s2", "speed_rad_s")  # columns without which nothing can be predicted
    parameters = {
        "inertia_kg_m2": Prior(0.50, 0.01, "kg·m²"),
        "viscous_Nm_s_per_rad": Prior(0.20, 0.01, "N·m·s/rad"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the channel, shape (time, axis); NaN where the simulation says nothing."""
        return (
            values["inertia_kg_m2"] * inputs["acceleration_rad_s2"]
            + values["viscous_Nm_s_per_rad"] * inputs["speed_rad_s"]
        )

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what left-out physics may depend on.

        `wheel_speed` is the speed that friction opposes, in rad/s or m/s; acceleration and angle follow from it.
        Friction in `predict` takes its sign from regolithd.calibration.mismatch.direction_of, 0 at standstill.
        """
        return {"wheel_speed": inputs["speed_rad_s"]}
