"""The readings of some wheels as one course: one wheel after the other, each in the order of time.

A column that is tried once, and not kept, is whitened in this order straight from where it was computed; it needs no
place among the columns of the design matrix, which are in the order of folds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.whitening import NOT_WHITENED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.signal.whitening import Whitening

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Course:
    """Where the readings are in other orders, and which of them are fitted.

    Attributes
    ----------
    whitening: of the noise
    runs: readings that follow each other on one wheel
    at: of each reading, its place in an array (time, wheel), flattened, shape (reading,)
    placed: of each reading that is fitted, its place in an array (one of these wheels, time by folds), flattened
    fitted: which readings are fitted, shape (reading,); None: all of them
    wheel: of each reading that is fitted, the number of its wheel among these
    """

    whitening: Whitening
    runs: tuple[slice, ...]
    at: Index
    placed: Index
    fitted: NDArray[np.bool_] | None
    wheel: Index

    def whitened(self, columns: Array) -> Single:
        """Return columns (column, time, wheel), whitened where they are fitted, shape (column, reading)."""
        values = columns.reshape(len(columns), -1)[:, self.at].astype(np.float32)
        if self.whitening is not NOT_WHITENED:
            values = self.whitening.apply(values, self.runs)
        return values if self.fitted is None else values[:, self.fitted]

    def ordered(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return (…, one of these wheels, time by folds) in the order of the readings that are fitted."""
        return values.reshape(*values.shape[:-2], -1)[..., self.placed]


def course_of(design: DesignMatrix, wheels: Sequence[int], folds: Sequence[int]) -> Course:
    """Return the readings of these wheels, of which those in these folds are fitted."""
    instants, every = design.problem.mask.shape
    of_wheels = [design.readings[wheel] for wheel in wheels]
    at = [design.order[places] * every + wheel for wheel, (places, _) in zip(wheels, of_wheels, strict=True)]
    placed = [places + instants * row for row, (places, _) in enumerate(of_wheels)]
    before = np.cumsum([0, *(len(places) for places, _ in of_wheels)])
    runs = [
        slice(run.start + int(first), run.stop + int(first))
        for first, (_, of_wheel) in zip(before[:-1], of_wheels, strict=True)
        for run in of_wheel
    ]
    everywhere = np.concatenate(placed)
    wheel = np.repeat(np.arange(len(of_wheels)), np.diff(before))
    if len(folds) == design.folds:
        return Course(design.whitening, tuple(runs), np.concatenate(at), everywhere, None, wheel)
    fold = np.searchsorted(design.cuts, everywhere % instants, side="right") - 1
    fitted = np.isin(fold, folds)
    return Course(design.whitening, tuple(runs), np.concatenate(at), everywhere[fitted], fitted, wheel[fitted])
