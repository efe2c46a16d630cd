"""The residual of an effect's wheels against the covariate that it depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Curve
from regolithd.calibration.mismatch.signal.binning import binned_means, even_edges

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Array, Evidence

BINS = 22
"""Bins of a curve (a choice: some 35 px each)."""
LEAST_IN_A_BIN = 10
"""Values in a bin on average, below which no curve is drawn (a choice)."""
BLOCK_S = 30.0
"""Length of the blocks that the noise is summed over [s]: several of its autocorrelation times (a choice)."""
SUBSTITUTES = {"direction": "wheel_speed", "none": "time"}
"""Covariates with too few values for a curve, and the one that shows the effect in their place."""


def curve_of(
    evidence: Evidence, covariate: str, wheels: Sequence[int | str], *, along_motion: bool = True
) -> Curve | None:
    """Return the mean residual of these wheels in bins of a covariate, before and after the effects.

    Bins hold equal numbers of values; a covariate with few distinct values (a row of wheels) has one bin for each.
    With `along_motion` the residual is multiplied by the sign of the speed. None where there is nothing to draw.
    """
    problem = evidence.problem
    shown = SUBSTITUTES.get(covariate, covariate)
    if problem is None or covariate == "wheel_angle":
        return None
    values = _covariate(evidence, shown)
    if values is None:
        return None
    on = np.isin(np.asarray(evidence.wheels), list(wheels))
    known = np.isfinite(evidence.before) & np.isfinite(values) & on
    drag = along_motion and covariate != "direction" and problem.reverses
    along = problem.covariates["direction"] if drag else np.ones(known.shape)
    if known.sum() < LEAST_IN_A_BIN * BINS:
        return None
    edges = _edges(values[known])
    if len(edges) < 3:
        return None
    residuals = [((evidence.measured - fitted) * along)[known] for fitted in (evidence.before, evidence.after)]
    binned = binned_means(values[known], edges, *residuals)
    before, after = binned.means
    error = _noise(evidence, known) / np.sqrt(binned.count)
    return Curve(shown, "drag" if drag else "offset", binned.at, before, after, error, tuple(wheels))


def _covariate(evidence: Evidence, name: str) -> Array | None:
    """Return a covariate's values, shape (time, wheel); wheel rows too."""
    problem = evidence.problem
    assert problem is not None  # noqa: S101  # the caller looked
    if name == "wheel_row":
        return None if problem.row is None else np.broadcast_to(problem.row, problem.mask.shape)
    return problem.covariates.get(name)


def _edges(values: Array) -> Array:
    """Return bin edges that hold equal numbers of values, or separate a few distinct ones."""
    distinct = np.unique(values[:: max(len(values) // 5000, 1)])
    if len(distinct) <= BINS // 2:
        middles = (distinct[1:] + distinct[:-1]) / 2
        return np.concatenate([[-np.inf], middles, [np.inf]])
    return even_edges(values, BINS)


def _noise(evidence: Evidence, known: np.ndarray) -> float:
    """Return the standard deviation of a mean of n values times √n, the noise's autocorrelation included."""
    block = (evidence.time_s // BLOCK_S).astype(np.int64)
    left = np.where(known, evidence.measured - evidence.after, 0.0)
    count = int(block.max()) + 1
    sums = np.stack([np.bincount(block, column, count) for column in left.T])
    numbers = np.stack([np.bincount(block, column, count) for column in known.T])
    return float(np.sqrt(np.sum(sums**2) / max(float(numbers.sum()), 1.0)))
