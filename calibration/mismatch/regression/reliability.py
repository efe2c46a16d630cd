"""Reliability of readings: those weigh less of which the prediction is in doubt by its inputs' stated errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.variance_components import variance_components

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

Array = NDArray[np.float64]
Single = NDArray[np.float32]

LEAST_LOST = 0.02
"""Share of what all readings know, weighted alike, below which their doubt is passed over (a choice: it would hardly
change an answer, and costs a second file of columns)."""


def reliability_of(design: DesignMatrix, residual: Array) -> Single | None:
    """Return by what readings are multiplied to scatter alike, shape (wheel, time in the order of folds).

    `residual` [time, wheel] shows how much they scatter, and which share of the doubt is true. None where no error is
    stated, or hardly any reading is in doubt.
    """
    doubt = design.problem.doubt
    if doubt is None:
        return None
    left, alone, together = (design.in_folds(each) for each in (residual, doubt.alone, doubt.together))
    places = [places for places, _ in design.readings]
    squares, known = ([each[wheel, at] for wheel, at in enumerate(places)] for each in (left**2, alone))
    constant, share = variance_components(squares, known)
    found = np.ones(left.shape, np.float32)
    for wheel, (at, level) in enumerate(zip(places, constant, strict=True)):
        if level > 0:
            found[wheel, at] = np.sqrt(level / (level + share * together[wheel, at]))
    kept = np.concatenate([found[wheel, at] for wheel, at in enumerate(places)])
    return found if 1 - np.mean(kept**2) > LEAST_LOST else None
