"""Where a prediction is at a limit of the machine: a saturated actuator, a relief valve that is open.

A force or a torque that acts on the machine does not show there: it acts before the limit. A load that the actuator
would have to overcome takes nothing from a current that is at its largest, and is not added to one that is limited.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.readings.outliers import FEWEST_AT_LIMIT

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem

Mask = NDArray[np.bool_]


def at_limit(problem: Problem) -> Mask:
    """Return where the prediction is at a limit, shape (time, wheel).

    That is at its largest or its smallest value, away from zero, where no free parameter moves it, though one does
    elsewhere on the wheel. A prediction of zero is none: an unloaded machine has friction all the same.
    """
    return problem.once("at a limit", lambda: _at_limit(problem)) > 0


def _at_limit(problem: Problem) -> NDArray[np.float64]:
    found = np.zeros(problem.mask.shape)
    for wheel, on in enumerate(problem.mask.T):
        predicted = problem.prediction[:, wheel]
        largest = predicted[on].max(initial=0.0)
        smallest = predicted[on].min(initial=0.0)
        extreme = on & (((predicted == largest) & (largest > 0)) | ((predicted == smallest) & (smallest < 0)))
        if extreme.sum() < FEWEST_AT_LIMIT:
            continue
        moved = np.zeros(len(on), np.bool_)
        for name in problem.free:
            moved |= problem.difference_quotient(name)[:, wheel] != 0
        if moved[on].any():
            found[extreme & ~moved, wheel] = 1.0
    return found
