"""Intervals over a fleet: of sizes, by what differs from recording to recording; of a date, by the fall of Δχ²."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.fleet.choice.courses import courses_over
from regolithd.calibration.mismatch.fleet.choice.search import course_cost
from regolithd.calibration.mismatch.fleet.choice.selection import without
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

Array = NDArray[np.float64]


def size_stds(equations: FleetEquations, fit: FleetFit, along: Array | None = None) -> Array:
    """Return the standard deviations of the coefficients, or of sums of them, `along` (sum, coefficient).

    The larger of that from the noise and of the sandwich estimator (White, 1980) over recordings, which counts what
    differs from one recording to the next.
    """
    scores = np.zeros((equations.count, len(fit.columns)))
    left = equations.left_moment(fit)
    for i in range(equations.count):
        scores[i] = np.einsum("jw,wj->j", fit.factors[:, i], left[i][:, fit.columns])
    correction = equations.count / max(equations.count - 1, 1)
    sandwich = correction * fit.covariance @ (scores.T @ scores) @ fit.covariance
    ways = np.eye(len(fit.columns)) if along is None else along
    variances = [np.einsum("sj,jk,sk->s", ways, each, ways) for each in (sandwich, fit.covariance)]
    return np.asarray(np.sqrt(np.maximum(*variances)), np.float64)


def onset_places(equations: FleetEquations, fit: FleetFit, index: int) -> tuple[int, int]:
    """Return the first and last recording with which an effect may begin: within the 90 % interval of its onset."""
    term, rest = fit.terms[index], without(fit, index)
    gains: dict[int, float] = {}
    for course in courses_over(equations.of_rovers(term.units.rovers), begins=term.group.begins):
        if course.kind in {"since", "growing"}:
            trial = equations.fit((*rest, replace(term, course=course)))
            gains[course.first] = max(gains.get(course.first, -np.inf), trial.delta_chi2 - course_cost(course))
    least = max(gains.values()) - THRESHOLDS.onset_fall
    possible = [first for first in equations.of_rovers(term.units.rovers) if gains.get(first, -np.inf) >= least]
    return possible[0], possible[-1]
