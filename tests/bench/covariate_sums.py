"""Sums in bins of a covariate as a recording would give them, made of a function and noise, for tests of curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.empirical.sums import CovariateSums

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

FOLDS, READINGS = 5, 20.0


def sums_with(
    truth: Callable[[Array], Array], x: Array, *, noise: float = 0.5, seed: int = 0, readings: float = READINGS
) -> CovariateSums:
    """Return sums of one wheel without other columns: so many readings in each bin and fold, a factor of 1."""
    rng = np.random.default_rng(seed)
    drawn = truth(x) + rng.normal(0, noise / np.sqrt(readings), (FOLDS, 1, len(x)))
    moment = readings * drawn
    within = readings * noise**2 * rng.chisquare(readings - 1, moment.shape) / readings
    empty = np.zeros((FOLDS, 1, 0))
    return CovariateSums(
        at=x,
        readings=np.full(len(x), FOLDS * readings),
        power=np.full(moment.shape, readings),
        moment=moment,
        cross=np.zeros((FOLDS, 1, len(x), 0)),
        gram=np.zeros((FOLDS, 1, 0, 0)),
        column_moment=empty,
        energy=np.sum(readings * drawn**2 + within, axis=2),
        counts=np.full((FOLDS, 1), readings * len(x)),
        precision=np.zeros(0),
        centre=np.zeros(0),
        weights=np.array([1 / noise**2]),
    )
