"""Readings that scatter by different amounts: a constant noise, and a share of a variance that is known beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

ROUNDS, SETTLED = 20, 0.003
"""Rounds of the weighted regression at most, and the change of κ at which it ends (a choice: weights hardly change)."""
LEAST_CONSTANT = 0.1
"""Share of a course's mean square that is constant noise at least (a choice: no reading knows everything)."""


def variance_components(
    squares: Sequence[Array], known: Sequence[Array], most: float = 1.0
) -> tuple[list[float], float]:
    """Return the constant variance of each course of readings, and the share κ of what is known to disturb them.

    A reading's square has the mean σ² + κ s², with s² from `known`, shape (reading,) as `squares`. Every course has a
    σ² of its own; κ, from 0 to `most`, is common: it is less than 1 where the disturbance is less than was stated. By
    regression of the squares, each with its own variance (iteratively reweighted).
    """
    least = [LEAST_CONSTANT * float(np.mean(each)) if each.size else 0.0 for each in squares]
    constant, share = [float(np.mean(each)) if each.size else 0.0 for each in squares], 1.0
    for turn in range(ROUNDS):
        weights = [
            1 / np.maximum(level + share * doubt, 1e-300) ** 2 for level, doubt in zip(constant, known, strict=True)
        ]
        away = [doubt - _mean(doubt, weight) for doubt, weight in zip(known, weights, strict=True)]
        moment = sum(float(np.sum(w * far * square)) for w, far, square in zip(weights, away, squares, strict=True))
        energy = sum(float(np.sum(w * far**2)) for w, far in zip(weights, away, strict=True))
        before, share = share, float(np.clip(moment / energy, 0.0, most)) if energy > 0 else 0.0
        constant = [
            max(_mean(square - share * doubt, weight), floor)
            for square, doubt, weight, floor in zip(squares, known, weights, least, strict=True)
        ]
        if abs(share - before) < SETTLED and turn > 0:
            break
    return constant, share


def _mean(values: Array, weights: Array) -> float:
    """Return the weighted mean; 0 of nothing."""
    return float(np.sum(values * weights) / np.sum(weights)) if values.size else 0.0
