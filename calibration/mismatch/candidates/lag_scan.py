"""Scan over delays: how well a residual fits a late column, to first order, at every delay at once.

Δy(t) = J(t) (u(t + d) − u(t)), with J the slope of the prediction with the column. Its products with the residual
and with itself are correlations over d, which the fast Fourier transform gives for all delays together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]


def best_lag(problem: Problem, values: Array, slope: Array, residual: Array, most: int) -> int:
    """Return the delay, in readings from 1 to `most`, at which a residual fits best; 0: at none.

    Values of the column, slope and residual have shape (time, wheel); readings that are not compared count nothing.
    """
    moment, energy = np.zeros(most + 1), np.zeros(most + 1)
    for here in problem.recording.runs:
        for k in range(values.shape[1]):
            mask = problem.mask[here, k] & np.isfinite(values[here, k])
            column = np.where(mask, values[here, k], 0.0)
            column -= column[mask].mean() if mask.any() else 0.0
            along = np.where(mask, slope[here, k], 0.0)
            left = np.where(mask, residual[here, k], 0.0)
            moment += _ahead(along * left, column, most) - np.sum(along * left * column)
            squares = along**2
            energy += _ahead(squares, column**2, most) - 2 * _ahead(squares * column, column, most)
            energy += np.sum(squares * column**2)
    gain = np.where((moment > 0) & (energy > 0), moment, 0.0) ** 2 / np.maximum(energy, 1e-300)
    return int(np.argmax(gain))


def _ahead(factor: Array, values: Array, most: int) -> Array:
    """Return Σ factor(t) values(t + d) for delays d of 0 to `most` readings; the last value is held beyond the end."""
    count = len(values)
    if not count:
        return np.zeros(most + 1)
    held = np.concatenate((values, np.full(most, values[-1])))
    size = 2 ** int(np.ceil(np.log2(len(held) + count)))
    product = np.fft.rfft(held, size) * np.conj(np.fft.rfft(factor, size))
    return np.asarray(np.fft.irfft(product, size)[: most + 1])
