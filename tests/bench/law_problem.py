"""A problem of a minute, four wheels in two rows, everything measured: candidates' columns are known in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.data.recording import Recording
from regolithd.calibration.mismatch.problem.prior import Prior
from regolithd.calibration.mismatch.problem.problem import Problem
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.candidates.candidate import Candidate

    Array = NDArray[np.float64]

TIMES, WHEELS, STEP_S = 121, 4, 0.5
CANDIDATES: dict[str, Candidate] = {candidate.name: candidate for candidate in library()}
TIME_S = STEP_S * np.arange(TIMES)[:, None] * np.ones(WHEELS)
SPEED = 0.3 * np.cos(TIME_S / 5) * np.array([1.0, 0.9, 1.1, 0.8]) + 0.01
LOAD = 50.0 + 5 * np.sin(TIME_S / 7) + np.array([0.0, 2.0, -3.0, 1.0])


class Linear(Simulation):
    """current = (cohesion + friction angle × load) × strength of the soil's variants, against the motion."""

    channel, unit = "current_A", "A"
    parameters: ClassVar = {"cohesion_Pa": Prior(2.0, 0.1), "friction_angle_deg": Prior(0.05, 0.01)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return a current that is linear in the parameters and in the load."""
        soil = values["cohesion_Pa"] + values["friction_angle_deg"] * inputs["load_N"]
        factor = values["stiffness_factor"] + 2 * values["shear_factor"] + 3 * values["slip_sinkage"]
        return np.sign(inputs["speed"]) * soil * factor

    def variants(self) -> Mapping[str, float]:
        """Return a soil model's variants."""
        return {"stiffness_factor": 1.0, "shear_factor": 0.0, "slip_sinkage": 0.0}


def problem() -> Problem:
    """Return a problem of a minute, four wheels in two rows, everything measured."""
    recording = Recording(TIME_S[:, 0], np.zeros(TIMES, np.int64), (1, 2, 3, 4), {"load_N": LOAD, "speed": SPEED})
    simulation = Linear()
    values = {name: prior.value for name, prior in simulation.parameters.items()}
    prediction = simulation.predict({"load_N": LOAD, "speed": SPEED}, {**simulation.variants(), **values})
    covariates = {
        "time": TIME_S,
        "wheel_speed": SPEED,
        "direction": np.sign(SPEED),
        "wheel_acceleration": np.gradient(SPEED, STEP_S, axis=0),
        "wheel_angle": np.cumsum(SPEED, axis=0) * STEP_S,
        "torque": np.abs(prediction),
        "temperature": -10 + TIME_S / 2 + np.arange(WHEELS),
        "pitch": 0.1 * np.sin(TIME_S / 11),
        "roll": 0.1 * np.cos(TIME_S / 13),
        "yaw_rate": np.where(TIME_S > 30, 0.02, 0.0),
        "slip": 0.1 + 0.05 * np.sin(TIME_S / 3),
        "load": LOAD,
        "place": 0.1 * TIME_S + np.array([0.3, 0.3, -0.3, -0.3]),
    }
    side, row = np.array([-1.0, 1.0, -1.0, 1.0]), np.array([0.0, 0.0, 1.0, 1.0])
    mask = np.ones(SPEED.shape, np.bool_)
    return Problem(recording, simulation, values, prediction, prediction, mask, covariates, side, row)


P = problem()
SIGN, PREDICTED = np.sign(SPEED), P.prediction
RELATIVE = np.abs(PREDICTED) / 3.0
WARM = P.covariates["temperature"]
