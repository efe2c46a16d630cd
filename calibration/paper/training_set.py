"""The paper's training set of 504 pairs (Sec. 3.1, Steps 1–15): inputs [W, i, I], outputs [c, tan φ].

The grid varies soil, current, slip and sinkage independently; the load then follows from Eq. 14 (Step 14). Most of the
loads are therefore outside what a 30 kg rover can have on one wheel (`docs/results/reproduction.md`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.paper.load_from_current import load_from_current
from regolithd.calibration.parameters import SOILS, Drivetrain, Wheel

Array = NDArray[np.float64]

CURRENTS_A = (0.050, 0.060, 0.070, 0.080, 0.090, 0.100)
SLIPS = (0.01, 0.02, 0.03)
SINKAGES_M = (0.005, 0.0075, 0.010, 0.0125, 0.015, 0.0175, 0.020)


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """The pairs, one in each row.

    Attributes
    ----------
    inputs
        Shape (pairs, 3): load [N], slip [1], motor current [A].
    outputs
        Shape (pairs, 2): cohesion [Pa], tan φ [1].
    soil
        Shape (pairs,): index into `SOILS`.
    gain_Nm_per_A
        Gain of Eq. 11 that the loads were computed with [N·m/A].
    """

    inputs: Array
    outputs: Array
    soil: NDArray[np.intp]
    gain_Nm_per_A: float


def training_set(drivetrain: Drivetrain, wheel: Wheel, rng: np.random.Generator | None = None) -> TrainingSet:
    """Return the 504 pairs: in the order of the grid, or shuffled if `rng` is given (Step 15)."""
    soils = list(SOILS.values())
    grid = np.array(list(itertools.product(range(len(soils)), CURRENTS_A, SLIPS, SINKAGES_M)))
    soil = grid[:, 0].astype(np.intp)
    current, slip, sinkage = grid[:, 1:].T
    cohesion = np.array([each.cohesion_Pa for each in soils], np.float64)[soil]
    tangent = np.tan(np.radians([each.friction_angle_deg for each in soils]))[soil]
    modulus = np.array([each.shear_modulus_m for each in soils])[soil]
    load = load_from_current(
        current,
        slip,
        sinkage,
        cohesion,
        tangent,
        modulus,
        radius_m=wheel.radius_m,
        width_m=wheel.width_m,
        gain_Nm_per_A=drivetrain.gain_Nm_per_A,
    )
    order = np.arange(len(grid)) if rng is None else rng.permutation(len(grid))
    inputs, outputs = np.column_stack([load, slip, current]), np.column_stack([cohesion, tangent])
    return TrainingSet(inputs[order], outputs[order], soil[order], drivetrain.gain_Nm_per_A)
