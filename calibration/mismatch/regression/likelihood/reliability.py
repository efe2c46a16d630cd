"""Reliability of readings: those weigh less that scatter more, and it is known why.

The prediction is in doubt by its inputs' stated errors; and many sensors' noise grows with what they measure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.design_matrix import Reliability
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.signal.noise_models.variance_components import variance_components
from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Single = NDArray[np.float32]

LEAST_LOST = 0.02
"""Share of what all readings know, weighted alike, below which their doubt is passed over (a choice: it would hardly
change an answer, and costs a second file of columns)."""
LEAST_RELIABILITY = 0.2
"""What a reading is multiplied by at least where that is passed over (a choice): a single one whose prediction is in
doubt by five deviations of the noise, beside a step of the simulation say, would be evidence by itself."""
LEAST_STDS = 5.0
"""Standard deviations by which noise has to grow with the size (a choice: of thousands of courses none by chance)."""
FURTHEST_STEP = 6.0
"""Steps between readings beyond which a residual jumps, in their robust deviation (a choice: at a reversal, or where an
input is set, it does for other reasons)."""


def reliability_of(design: DesignMatrix, residual: Array) -> Reliability | None:
    """Return by what readings are multiplied to scatter alike.

    `residual` [time, wheel] shows which share of the doubt is true. None where they scatter alike, or hardly any does
    not.
    """
    problem = design.problem
    if problem.doubt is None and problem.noise_size is None:
        return None
    found = _by_doubt(design, design.in_folds(residual))
    if problem.noise_size is not None:
        growth = np.maximum(design.in_folds(problem.noise_size), 1.0).astype(np.float32)
        found = Reliability(found.alone / growth, found.in_means / growth)
    kept = np.concatenate([found.in_means[wheel, at] for wheel, (at, _) in enumerate(design.readings)])
    return found if 1 - np.mean(kept**2) > LEAST_LOST or kept.min(initial=1.0) < LEAST_RELIABILITY else None


def noise_size_of(equations: NormalEquations, fit: Fit) -> Array | None:
    """Return by how much the noise's deviation grows with the predicted size, shape (time, wheel); None: it does not.

    On each wheel by itself, by the steps that what a fit leaves makes from one reading to the next, in which slow
    physics that is left out hardly shows.
    """
    design, problem = equations.design, equations.problem
    if problem.arbitrary_zero:
        return None
    left = design.in_folds(residual_of(equations, fit))
    left = left * _by_doubt(design, left).alone
    size = design.in_folds(problem.filled) ** 2
    found, lost = np.ones(problem.mask.shape), 0.0
    for wheel, (at, runs) in enumerate(design.readings):
        squares, between = _steps(left[wheel, at], size[wheel, at], runs)
        if not (squares.any() and between.any()):
            continue
        relative = float(np.mean(squares)) / float(np.mean(between))
        (level,), share = variance_components([squares], [between * relative])
        if share >= LEAST_STDS * _std_of_share(between * relative, level + share * between * relative):
            growth = share * relative * problem.filled[:, wheel] ** 2 / level
            found[:, wheel] = np.sqrt(1 + growth)
            lost = max(lost, 1 - float(np.mean(1 / (1 + growth[problem.mask[:, wheel]]))))
    return found if lost > LEAST_LOST else None


def _by_doubt(design: DesignMatrix, left: Array) -> Reliability:
    """Return the factors for what the inputs' stated errors add."""
    doubt, shape = design.problem.doubt, left.shape
    each, many = np.ones(shape, np.float32), np.ones(shape, np.float32)
    if doubt is None:
        return Reliability(each, many)
    alone, together = (design.in_folds(values) for values in (doubt.alone, doubt.together))
    places = [places for places, _ in design.readings]
    squares, known = ([values[wheel, at] for wheel, at in enumerate(places)] for values in (left**2, alone))
    constant, share = variance_components(squares, known, doubt.most)
    for wheel, (at, level) in enumerate(zip(places, constant, strict=True)):
        if level > 0:
            each[wheel, at] = np.sqrt(level / (level + share * alone[wheel, at]))
            many[wheel, at] = np.sqrt(level / (level + share * together[wheel, at]))
    return Reliability(each, many)


def _std_of_share(known: Array, variances: Array) -> float:
    """Return the standard deviation of the share that squared steps show, of which neighbours have a reading in common.

    The square of a normal step has twice the square of its variance; with half of it in common on either side, three
    times.
    """
    weights = 1 / variances**2
    away = known - float(np.sum(weights * known) / np.sum(weights))
    return float(np.sqrt(3 / max(float(np.sum(weights * away**2)), 1e-300)))


def _steps(left: Array, size: Array, runs: Sequence[slice]) -> tuple[Array, Array]:
    """Return half the squared steps of the residual within runs, without jumps, and the mean size at their ends."""
    steps = np.concatenate([np.diff(left[run]) for run in runs] or [np.zeros(0)])
    between = np.concatenate([(size[run][1:] + size[run][:-1]) / 2 for run in runs] or [np.zeros(0)])
    noise = np.abs(steps) <= FURTHEST_STEP * robust_std(steps)
    return steps[noise] ** 2 / 2, between[noise]
