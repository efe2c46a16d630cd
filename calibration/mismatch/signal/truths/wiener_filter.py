"""Wiener filter: the truth of a column as a stationary process of any spectrum.

A load that goes up and down with each stroke, or a wave, is neither first-order autoregressive nor smooth: its
readings are told best by those one and two strokes before and after. For readings with independent errors of the
variance R, the linear function of the readings of a window that has the least mean square error is, at place j,

    truth_j = reading_j − R Σ_k (G⁻¹)_jk reading_k,

G being the second moments of the readings in such windows (Wiener, 1949). The same minimises Stein's unbiased estimate
of the error over all linear functions of a window (`stein.py`), so that nothing is assumed of the truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches
from regolithd.calibration.mismatch.signal.truths.smoothing_spline import BRIDGED, even_steps
from regolithd.calibration.mismatch.signal.truths.stein import Estimate, squared_error

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

HALF_WIDTHS = (6, 12, 24, 48)
"""Readings before and after, of which an estimate is a function (a choice: each twice as far as the one before)."""
FEWEST_WINDOWS = 6
"""Windows for each weight that is found from them, at least (a choice: chance adds a sixth of the error then)."""
FLOOR_HALF_WIDTH, QUIETEST = 12, 0.25
"""Readings before and after in a window of which the noise is asked, and the share of its directions that are noise
alone at least (a choice: six oscillations leave half of them; chance makes the deviation a fifteenth too low)."""
FILLINGS = 2
"""Rounds in which a blank gets the estimate that its neighbours give, the first from a straight line (a choice)."""


@dataclass(frozen=True, eq=False)
class WienerFilter:
    """Weights of the readings in a window of 2 `half_width` + 1 instants, shape (reading, place of the estimate)."""

    half_width: int
    weights: Array

    @classmethod
    def of(cls, windows: Array, variance: float) -> WienerFilter:
        """Return the filter for readings like these, shape (window, instant), with errors of this variance.

        Time may run either way, and no direction of the readings has less than the error.
        """
        moments = windows.T @ windows / len(windows)
        size, axes = np.linalg.eigh((moments + moments[::-1, ::-1]) / 2)
        kept = np.clip(1 - variance / np.maximum(size, np.finfo(float).tiny), 0.0, None)
        return cls(windows.shape[1] // 2, (axes * kept) @ axes.T)

    @property
    def fitted(self) -> int:
        """How many numbers of an estimate were found from the readings."""
        return self.half_width + 1

    def estimate(self, filled: Array, pieces: Sequence[slice], variance: float) -> Estimate:
        """Return the estimates, shape (time,), NaN out of the pieces and in those that are shorter than a window.

        Their variance is what stands for it in Stein's lemma: that of the error times the weight of the own reading.
        """
        length, middle = len(self.weights), self.half_width
        mean, own = np.full(filled.shape, np.nan), np.full(filled.shape, np.nan)
        of_own = np.diagonal(self.weights)
        for piece in pieces:
            read = filled[piece]
            if len(read) < length:
                continue
            first, last = self.weights[:, :middle], self.weights[:, middle + 1 :]
            between = np.convolve(read, self.weights[::-1, middle], "valid")
            mean[piece] = np.concatenate([read[:length] @ first, between, read[-length:] @ last])
            own[piece] = np.concatenate([of_own[:middle], np.full(len(between), of_own[middle]), of_own[middle + 1 :]])
        return Estimate(mean, variance * own)

    def applied(self, readings: Array, pieces: Sequence[slice], variance: float) -> Estimate:
        """Return the estimates from readings (time,) with NaN where there are none."""
        filled, blank = _bridged(readings), ~np.isfinite(readings)
        found = self.estimate(filled, pieces, variance)
        for _ in range(FILLINGS if blank.any() else 0):
            filled = np.where(blank & np.isfinite(found.mean), found.mean, filled)
            found = self.estimate(filled, pieces, variance)
        return found


def best_filter(
    readings: Array, variance: float, pieces: Sequence[slice], exact: NDArray[np.bool_]
) -> WienerFilter | None:
    """Return the filter whose mean square error is least by Stein's estimate, over the readings that are not exact.

    Each number that was fitted makes the error look smaller by two error variances over the number of readings. None:
    the pieces are too short.
    """
    filled, told = _bridged(readings), np.isfinite(readings) & ~exact
    best, least = None, np.inf
    for half_width in HALF_WIDTHS:
        windows = _windows(filled, told, pieces, half_width)
        if len(windows) < FEWEST_WINDOWS * (half_width + 1):
            break
        found = WienerFilter.of(windows, variance)
        estimate = found.applied(readings, pieces, variance)
        known = told & np.isfinite(estimate.mean)
        error = squared_error(readings[known], variance, Estimate(estimate.mean[known], estimate.variance[known]))
        size = float(error.mean()) + 2 * found.fitted * variance / len(error)
        if size < least:
            best, least = found, size
    return best


def noise_floor(readings: Array, pieces: Sequence[slice]) -> float:
    """Return the variance of white noise in readings (time,) at most: what a window has in its quietest directions.

    A course of a few oscillations, however quick, leaves directions in which there is nothing but noise. Infinite
    where the pieces are too short.
    """
    known = np.isfinite(readings)
    if not known.any():
        return np.inf
    windows = _windows(_bridged(readings - np.mean(readings[known])), known, pieces, FLOOR_HALF_WIDTH)
    if len(windows) < FEWEST_WINDOWS * windows.shape[1]:
        return np.inf
    size = np.linalg.eigvalsh(windows.T @ windows / len(windows))
    return max(float(np.quantile(size, QUIETEST)), 0.0)


def even_pieces(readings: Array, time: Array, run: NDArray[np.int64]) -> list[slice]:
    """Return the stretches of a recording in which readings follow each other at even steps, with few blanks."""
    within, _ = even_steps(time, run)
    known = np.flatnonzero(np.isfinite(readings))
    for place in np.flatnonzero(np.diff(known) > BRIDGED + 1):
        within[known[place] : known[place + 1]] = False
    return [slice(first, last + 1) for first, last in stretches(within)]


def _windows(filled: Array, told: NDArray[np.bool_], pieces: Sequence[slice], half_width: int) -> Array:
    """Return the windows about each reading that has an error, shape (window, instant)."""
    length = 2 * half_width + 1
    found = [np.empty((0, length))]
    for piece in pieces:
        read, of_piece = filled[piece], told[piece]
        if len(read) >= length:
            found.append(sliding_window_view(read, length)[of_piece[half_width : len(read) - half_width]])
    return np.concatenate(found)


def _bridged(readings: Array) -> Array:
    """Return readings with a straight line where there are none."""
    known, at = np.isfinite(readings), np.arange(len(readings))
    return readings if known.all() or not known.any() else np.interp(at, at[known], readings[known])
