"""A change point and its interval: where the Δχ² of an effect that begins at a time falls by what chance allows.

How the effect developed after its onset is unknown too. The best onset of all developments is a poor estimate where a
slow beginning before and a quick one after explain a recording almost equally well: the estimate is the median of the
likelihood over onsets and developments, which has the least expected distance. Of an effect that wanders the likelihood
has a Brownian motion in it as well (`inference.wandering_onset`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.uncertainty.parameter_interval import NINE_TENTHS
from regolithd.calibration.mismatch.inference.uncertainty.wandering_onset import likelihood
from regolithd.calibration.mismatch.selection.shape_optimisation import shape_profile
from regolithd.calibration.mismatch.signal.density import quantiles

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]

SHARES = (NINE_TENTHS[0], 0.5, NINE_TENTHS[1])
"""Of the likelihood that lie below an interval's lower bound, the estimate and the upper bound."""
GRID = 48
"""Onsets of the likelihood's grid (a choice: one in each 2 % of the recording; the tolerance is a tenth)."""
OVERCONFIDENCE = 4.0
"""Factor by which Δχ² between onsets is too large: no development is exactly the true one. In 16 blind trials of drifts
that were taken for steady and wandered by 15 % the true onset lay 5.5 below the best in the mean, and should have lain
about 1 below; 4 and 8 place it equally well."""
FIRST_STEP, LONGEST_STEP = 0.002, 0.3
"""Distance from the best onset at which the search begins and ends, as shares of the recording."""
MARGIN = 0.01
"""Least distance of the onset from its bounds, as a share of their distance."""
BISECTIONS = 6
"""To within a sixty-fourth of the distance."""


def onset_interval(equations: NormalEquations, fit: Fit, index: int) -> tuple[float, float, float]:
    """Return a term's onset [s] and the bounds that hold it nine times in ten, within those of the candidate.

    Of an effect that wanders the bounds are quantiles of the same likelihood as the estimate: where none of the
    developments is the true one, the best of them is no measure of what chance allows.
    """
    term, problem = fit.terms[index], equations.problem
    candidate, shape = term.group.candidate, term.group.shape
    assert candidate is not None  # noqa: S101  # only named terms come here
    profile = shape_profile(equations, fit.without(index), candidate, term.wheels)
    onset = candidate.change_point
    at, length_s = float(shape[onset]), problem.length_s
    # The fitted one too: its numbers may be no usual ones.
    developments = [*candidate.onset_profiles(problem), {name: value for name, value in shape.items() if name != onset}]

    def gains(onset_s: float) -> list[float]:
        return [profile({**development, onset: onset_s}) for development in developments]

    def within(onset_s: float) -> bool:
        return max(gains(onset_s)) > least

    first, last = candidate.bounds(problem, shape)[onset]
    grid = np.linspace(first, last, GRID)
    if candidate.wanders:
        density = likelihood(profile, grid, developments, _size(equations, fit, index))
        low, value, high = quantiles(grid, density, SHARES)
        return value, low, high

    def median(onsets: Array) -> float:
        (found,) = quantiles(onsets, _density(np.array([gains(float(onset_s)) for onset_s in onsets])), (0.5,))
        return float(found)

    value = median(grid)
    least = max(profile(shape), *gains(at)) - equations.thresholds.onset_fall
    low = max(at - _distance(lambda far: within(at - far), length_s), first)
    high = min(at + _distance(lambda far: within(at + far), length_s), last)
    if not low <= value <= high:  # of what is possible, the middle
        value = median(np.linspace(low, high, GRID))
    inside = low + MARGIN * (high - low), high - MARGIN * (high - low)
    return float(np.clip(value, *inside)), low, high


def _size(equations: NormalEquations, fit: Fit, index: int) -> float:
    """Return the largest of a term's coefficients, with the unit of the channel."""
    coefficients = fit.coefficients[fit.of_term(index)] / equations.design.scale[list(fit.terms[index].group.columns)]
    return float(np.max(np.abs(coefficients)))


def _density(gains: Array) -> Array:
    """Return the likelihood exp(Δχ²/2) of each onset, every development as likely before, of gains (onset, way)."""
    return np.asarray(np.exp((gains - gains.max()) / (2 * OVERCONFIDENCE)).sum(axis=1))


def _distance(inside: Callable[[float], bool], length_s: float) -> float:
    """Return the distance up to which `inside` holds, by doubling and bisection."""
    near, far = 0.0, FIRST_STEP * length_s
    while far < LONGEST_STEP * length_s and inside(far):
        near, far = far, 2 * far
    for _ in range(BISECTIONS):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if inside(middle) else (near, middle)
    return far
