"""The interval of a change point: where the Δχ² of an effect that begins at a time falls by what chance allows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.selection.shape_optimisation import shape_profile

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

FIRST_STEP, LONGEST_STEP = 0.002, 0.3
"""Distance from the best onset at which the search begins and ends, as shares of the recording."""
BISECTIONS = 6
"""To within a sixty-fourth of the distance."""


def onset_bounds(equations: NormalEquations, fit: Fit, index: int) -> tuple[float, float]:
    """Return the bounds of a term's onset [s] that hold it nine times in ten.

    How the effect developed after its onset is unknown too: at each onset the best development counts.
    """
    term, problem = fit.terms[index], equations.problem
    candidate, shape = term.group.candidate, term.group.shape
    assert candidate is not None  # noqa: S101  # only named terms come here
    profile = shape_profile(equations, fit.without(index), candidate, term.wheels)
    onset = candidate.change_point
    at, length_s = float(shape[onset]), problem.length_s
    developments = candidate.onset_profiles(problem)

    def gain(onset_s: float) -> float:
        return max(profile({**development, onset: onset_s}) for development in developments)

    least = max(profile(shape), gain(at)) - equations.thresholds.onset_fall
    before = _distance(lambda far: gain(at - far) > least, length_s)
    after = _distance(lambda far: gain(at + far) > least, length_s)
    return float(np.clip(at - before, 0, length_s)), float(np.clip(at + after, 0, length_s))


def _distance(inside: Callable[[float], bool], length_s: float) -> float:
    """Return the distance up to which `inside` holds, by doubling and bisection."""
    near, far = 0.0, FIRST_STEP * length_s
    while far < LONGEST_STEP * length_s and inside(far):
        near, far = far, 2 * far
    for _ in range(BISECTIONS):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if inside(middle) else (near, middle)
    return far
