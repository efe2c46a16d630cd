"""MSE of our perceptrons in several scalings of the outputs: which of them allows the paper's 0.0251."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.paper.training_set import TrainingSet

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Scaling:
    """A scaling of the outputs, the variance of the outputs in it, and our MSE in it."""

    name: str
    variance: float
    mse: float


def scalings(pairs: TrainingSet, estimates: Array) -> list[Scaling]:
    """Return the MSE of `estimates` (shape as the pairs' outputs) in each scaling of the outputs.

    Each scaling is linear in c and in tan φ, so the errors of one network can be converted to all of them.
    """
    outputs = pairs.outputs
    span = outputs.max(axis=0) - outputs.min(axis=0)
    units = {
        "c in 10 kPa, tan φ unscaled": np.array([10_000.0, 1.0]),
        "both scaled to [0, 1]": span,
        "both scaled to [−1, 1]": span / 2,
        "c in kPa, tan φ unscaled": np.array([1000.0, 1.0]),
        "c in Pa, tan φ unscaled": np.array([1.0, 1.0]),
    }
    error = estimates - outputs
    return [
        Scaling(name, float(np.mean(outputs.var(axis=0) / unit**2)), float(np.mean((error / unit) ** 2)))
        for name, unit in units.items()
    ]
