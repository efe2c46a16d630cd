"""In which units the MSE of 0.0251 can have been: our networks read in other scalings of the outputs."""

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
    """One way to scale the outputs, the outputs' variance in it, and the MSE that explains as much as ours does."""

    name: str
    variance: float
    mse: float


def scalings(pairs: TrainingSet, estimates: Array) -> list[Scaling]:
    """Return our networks' MSE in each scaling of the outputs; `estimates` has the shape of the pairs' outputs.

    Each scaling is linear in c and in tan φ, so that one network's errors can be read in all of them.
    """
    outputs = pairs.outputs
    span = outputs.max(axis=0) - outputs.min(axis=0)
    units = {
        "c in 10 kPa, tan φ as it is": np.array([10_000.0, 1.0]),
        "both brought to [0, 1]": span,
        "both brought to [−1, 1]": span / 2,
        "c in kPa, tan φ as it is": np.array([1000.0, 1.0]),
        "c in Pa, tan φ as it is": np.array([1.0, 1.0]),
    }
    error = estimates - outputs
    return [
        Scaling(name, float(np.mean(outputs.var(axis=0) / unit**2)), float(np.mean((error / unit) ** 2)))
        for name, unit in units.items()
    ]
