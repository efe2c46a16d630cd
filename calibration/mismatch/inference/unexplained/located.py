"""Where a structure without a name acts: from when to when, and how much of the residual it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.groups.smooth_groups import couplings_of
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.likelihood.as_read import AsRead
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]


def share_of_residual(equations: NormalEquations, read: AsRead, term: Term) -> float:
    """Return a term's share of the power, on its wheels, of what the calibrated simulation leaves.

    What it leaves is counted at the parameters of the fit with all terms: those of a fit without them absorb a part.
    From the term's own power that is taken which its coefficients have by chance, a long-run variance each.
    """
    on, whole = list(term.wheels), read.fit
    terms = [contribution(equations, whole, index)[:, on] for index in range(len(whole.terms))]
    left = residual_of(equations, whole)[:, on] + sum(terms)
    own = np.sum(terms[whole.terms.index(term)] ** 2)
    by_chance = len(term.group.columns) * float(np.mean(1 / read.weights[on]))
    return float(np.clip((own - by_chance) / max(float(np.sum(left**2)), 1e-300), 0.0, 1.0))


def spell_of(equations: NormalEquations, read: AsRead, term: Term) -> tuple[float, float]:
    """Return from when to when a term acts [s]: the stretch of time in which it explains most beyond chance.

    At each instant it takes something from the weighted sum of squares. Fitted coefficients do so by chance too, and
    are charged for it by Akaike's criterion, each for its part of the time.
    """
    on, limits = list(term.wheels), equations.thresholds
    whole, weights = read.fit, read.weights[on]
    own = contribution(equations, whole, whole.terms.index(term))[:, on]
    left = residual_of(equations, whole)[:, on]
    gained = ((left + own) ** 2 - left**2) @ weights
    charged = limits.coefficient_penalty * len(term.group.columns) / len(gained)
    first, last = largest_stretch(gained - charged)
    time_s = equations.problem.time_s[:, 0]
    region = term.group.region
    if region is not None and term.name == "time":
        return max(region.lower, float(time_s[0])), min(region.upper, float(time_s[-1]))
    if region is None and term.name == "time" and term.group.coupling in couplings_of(equations.problem):
        first, last = _between_knots(_level(equations, term, own, left, weights), first, last, len(term.group.columns))
    return float(time_s[first]), float(time_s[last])


def largest_stretch(values: Array) -> tuple[int, int]:
    """Return first and last index of the stretch whose sum is largest (Kadane)."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    lowest = np.minimum.accumulate(sums[:-1])
    last = int(np.argmax(sums[1:] - lowest))
    return int(np.argmin(sums[: last + 1])), last


def _between_knots(level: Array, first: int, last: int, knots: int) -> tuple[int, int]:
    """Return where a stretch begins and ends: a curve over time has its knots too far apart to tell."""
    end, knot = level.shape[1] - 1, max(level.shape[1] // knots, 1)
    half = max((last - first) // 2, 1)
    return _edge(level, first, knot, half), end - _edge(level[:, ::-1], end - last, knot, half)


def _level(equations: NormalEquations, term: Term, own: Array, left: Array, weights: Array) -> Array:
    """Return, at each instant, the curve over its factor, the factor's power, and its product with the data."""
    on = list(term.wheels)
    factor = np.where(equations.problem.mask, couplings_of(equations.problem)[term.group.coupling], 0.0)[:, on]
    weighted = factor * weights
    power = np.sum(weighted * factor, axis=1)
    level = np.sum(weighted * own, axis=1) / np.where(power > 0, power, np.inf)
    return np.stack((level, power, np.sum(weighted * (own + left), axis=1)))


def _edge(level: Array, near: int, knot: int, half: int) -> int:
    """Return where a stretch begins: a step to the level that the curve has two knots later, where it explains most.

    It is looked for from a knot before `near` to two after, and in the first half of the stretch.
    """
    inside = level[0, near : near + min(2 * knot, half) + 1]
    step = inside[np.argmax(np.abs(inside))]
    at = slice(max(near - knot, 0), near + min(2 * knot, half) + 1)
    gained = 2 * step * level[2, at] - step**2 * level[1, at]
    return at.start + int(np.argmax(np.cumsum(gained[::-1])[::-1]))
