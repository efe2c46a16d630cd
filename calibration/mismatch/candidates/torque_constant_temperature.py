"""Torque constant that falls as the magnets warm up: the same torque needs more current."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import (
    SHAPE_TOLERANCE,
    UNLIKELY_SHAPE_PENALTY,
    Array,
    Candidate,
    Coefficient,
    Shape,
)
from regolithd.calibration.mismatch.candidates.celsius import known_temperature_degC, temperature_degC

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

REFERENCES_DEGC = (25.0, 20.0)
"""Reference temperatures of data sheets."""
OTHER_REFERENCE_DEGC = 0.0
"""Reference temperature of a cold calibration."""
OTHER_REFERENCE_PENALTY = 4.6
"""Δχ² charged for a reference that no data sheet has: odds of one in ten, 2 ln 10 (a choice: a gain that was identified
on the machine itself, unstated). Another reference is another gain: without this the gain's prior alone decides."""
LARGEST_LOSS = 2 / 3
"""Largest share of the torque constant that may be lost (a choice: a third is left)."""


class TorqueConstantTemperature(Candidate):
    """k_t = k_0 (1 − α (T − T_0)): remanence falls with temperature, and the current is the torque over k_t.

    T_0 is the simulation's `motor_constant_at_degC`. Where it states none, T_0 is the best of 25 °C and 20 °C, as data
    sheets have it, and, where that gains much more, of 0 °C and the recording's mean temperature. The answer says
    which: α is per kelvin and relative to the torque constant at T_0, and the gain that is told beside it is at T_0.

    It is looked for in every predicted load, as a reading that exceeds the prediction by a share that grows with the
    temperature: a torque or a force that was computed from the current does so. That of a sensor of its own does not:
    leave the effect out of `candidates` there.
    """

    name = "torque-constant-temperature"
    covariate = "temperature"
    equation = "Δy = y_sim (1/(1 − α (T − T_0)) − 1)"
    words = "a torque constant that falls as the {temperature} rises"
    signature = "a residual along the predicted current that grows with temperature, through zero at T_0"
    experiment = "start cold, warm up, cool down and repeat, so that the {temperature} does not follow the time"
    source = "magnet data sheets: NdFeB −0.1 %/K, ferrite −0.2 %/K, T_0 20 to 25 °C"
    requires = ("temperature", "torque")
    loads = True
    shape_keys: ClassVar = {
        "reference_degC": "T_0",
        "bent_per_K": "α in the denominator: `temperature_coefficient`, to 2 %",
    }
    coefficients: ClassVar = (Coefficient("temperature_coefficient", "1/K"),)

    def words_for(self, shape: Shape) -> str:
        """Return the words with the reference temperature."""
        return (
            f"{self.words} above {float(shape['reference_degC']):.4g} °C" if "reference_degC" in shape else self.words
        )

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return the stated reference temperature; else those of data sheets, a cold one and the recording's mean."""
        stated = problem.simulation.motor_constant_at_degC
        middle = float(np.nanmean(temperature_degC(problem)[problem.mask]))
        references = (*REFERENCES_DEGC, OTHER_REFERENCE_DEGC, middle) if stated is None else (float(stated),)
        return [{"reference_degC": t, "bent_per_K": 0.0} for t in references]

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:
        """Return the shape with α as fitted, as long as a third of the torque constant is left."""
        warmest = float(np.max(self._warmer(problem, shape)[problem.mask]))
        most = LARGEST_LOSS / warmest if warmest > 0 else np.inf
        bent = float(np.clip(values[0], 0.0, most))
        return (
            shape if abs(bent - float(shape["bent_per_K"])) < SHAPE_TOLERANCE * bent else {**shape, "bent_per_K": bent}
        )

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:
        """Charge a factor that does not change on any wheel: there a wrong gain is the simpler model.

        And a reference temperature that neither the simulation nor a data sheet states.
        """
        if not problem.changes_within(self._warmer(problem, shape)):
            return UNLIKELY_SHAPE_PENALTY
        known = {*REFERENCES_DEGC, problem.simulation.motor_constant_at_degC}
        return 0.0 if shape["reference_degC"] in known else OTHER_REFERENCE_PENALTY

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return (T − T_0)/(1 − α (T − T_0)) times the prediction, with α from the shape."""
        warmer = self._warmer(problem, shape)
        # Where it is warmer than in the recording of the identification, a third of the torque constant is left.
        left = np.maximum(1 - float(shape.get("bent_per_K", 0.0)) * warmer, 1 - LARGEST_LOSS)
        return (warmer / left * problem.filled)[None]

    def _warmer(self, problem: Problem, shape: Shape) -> Array:
        return known_temperature_degC(problem) - float(shape["reference_degC"])
