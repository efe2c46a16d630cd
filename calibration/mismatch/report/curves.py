"""The residual of the wheels that an effect is on, against the covariate that orders it: what its section shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Curve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Array, Evidence

BINS = 22
BLOCK_S = 30.0
SIGNED = frozenset({"pitch", "none", "wheel_acceleration"})
"""Covariates along which an effect has a sign of its own, whatever the direction of rotation."""
INSTEAD = {"direction": "wheel_speed", "none": "time"}
"""What shows an effect better than its own covariate, which has too few values."""


def curve_of(evidence: Evidence, covariate: str, wheels: Sequence[int]) -> Curve | None:
    """Return the residual before and after on these wheels alone; None where it cannot be drawn.

    Bins share the data evenly; a covariate with few values (a row of wheels) has one bin for each.
    """
    problem = evidence.problem
    shown = INSTEAD.get(covariate, covariate)
    if problem is None or covariate == "wheel_angle":
        return None
    values = _covariate(evidence, shown)
    if values is None:
        return None
    on = np.isin(np.asarray(evidence.wheels), list(wheels))
    known = np.isfinite(evidence.before) & np.isfinite(values) & on
    signed = covariate in SIGNED or "direction" not in problem.covariates
    along = np.where(signed or covariate == "direction", 1.0, problem.covariates.get("direction", np.ones(known.shape)))
    if known.sum() < 10 * BINS:
        return None
    edges = _edges(values[known])
    if len(edges) < 3:
        return None
    which = np.clip(np.searchsorted(edges, values[known], side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(which, minlength=len(edges) - 1), 1)
    before, after = (
        np.bincount(which, ((evidence.measured - fitted) * along)[known], len(edges) - 1) / count
        for fitted in (evidence.before, evidence.after)
    )
    at = np.bincount(which, values[known], len(edges) - 1) / count
    error = _noise(evidence, known) / np.sqrt(count)
    return Curve(
        shown, "offset" if signed or covariate == "direction" else "drag", at, before, after, error, tuple(wheels)
    )


def _covariate(evidence: Evidence, name: str) -> Array | None:
    """Return a covariate's values, shape (time, wheel); wheel rows too."""
    problem = evidence.problem
    assert problem is not None  # noqa: S101  # the caller looked
    if name == "wheel_row":
        return None if problem.row is None else np.broadcast_to(problem.row, problem.mask.shape)
    return problem.covariates.get(name)


def _edges(values: Array) -> Array:
    """Return bin edges that share the data evenly, or part a few distinct values."""
    distinct = np.unique(values[:: max(len(values) // 5000, 1)])
    if len(distinct) <= BINS // 2:
        middles = (distinct[1:] + distinct[:-1]) / 2
        return np.concatenate([[-np.inf], middles, [np.inf]])
    return np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))


def _noise(evidence: Evidence, known: np.ndarray) -> float:
    """Return the standard deviation that a mean of n values has, times √n: the noise's memory is in it."""
    block = (evidence.time_s // BLOCK_S).astype(np.int64)
    left = np.where(known, evidence.measured - evidence.after, 0.0)
    count = int(block.max()) + 1
    sums = np.stack([np.bincount(block, column, count) for column in left.T])
    numbers = np.stack([np.bincount(block, column, count) for column in known.T])
    return float(np.sqrt(np.sum(sums**2) / max(float(numbers.sum()), 1.0)))
