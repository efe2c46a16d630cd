"""Sign-flip test over a fleet: the score that the search finds where nothing is missing.

Blocks of each recording's remaining residual get new signs, and are searched in the same way as the fleet: over rovers,
wheels and dates. See `selection.sign_flip_test`, which does so for one recording.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.fleet.choice.equations import column_map
from regolithd.calibration.mismatch.fleet.choice.search import course_cost, may_share, penalty, summed_over
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm
from regolithd.calibration.mismatch.regression.screening.schur import delta_chi2_of_each, schur_diagonal
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.search import Place
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

Array = NDArray[np.float64]

DRAWS = 300
"""Draws (a choice: half as many as for one recording; three draws are beyond the quantile of 1 %)."""
BATCH = 50
"""Draws that are computed at once (a choice: some ten MiB)."""


def entry_threshold(equations: FleetEquations, places: Sequence[Place]) -> float:
    """Return the score above which a term may be named: a quantile of the largest score by chance, within limits."""
    limits, fit = THRESHOLDS, equations.fit(())
    generator = np.random.default_rng(0)
    largest = []
    for _ in range(DRAWS // BATCH):
        moments = _drawn(equations, generator)
        largest.append(_largest_scores(equations, fit, moments, places))
    quantile = np.quantile(np.concatenate(largest), 1 - limits.false_name_rate) + limits.sign_flip_margin
    return float(np.clip(quantile, limits.least_entry, limits.largest_entry))


def _drawn(equations: FleetEquations, generator: np.random.Generator) -> Array:
    """Return moments with the signs of all blocks drawn anew, by what is known, (draw, recording, wheel, column)."""
    drawn = np.zeros((BATCH, *equations.moment.shape))
    for i, sums in enumerate(equations.sums):
        own, fleet = column_map(sums, equations.tangents, equations.groups)
        at = [equations.wheels.index(name) for name in sums.wheels]
        signs = generator.choice([-1.0, 1.0], (BATCH, *sums.blocks.shape[:2]))
        flipped = np.einsum("dbw,bwc->dwc", signs, sums.blocks[:, :, own], optimize=True)
        drawn[:, i][:, np.array(at)[:, None], np.array(fleet)[None, :]] = flipped * equations.reductions[i, fleet]
    return drawn


def _largest_scores(equations: FleetEquations, fit: FleetFit, moments: Array, places: Sequence[Place]) -> Array:
    """Return the largest score of single-column candidates in each draw, shape (draw,)."""
    fitted = np.einsum("jiw,diwj->dj", fit.factors, moments[:, :, :, fit.columns], optimize=True) @ fit.covariance
    largest = np.full(len(moments), -np.inf)
    for place in places:
        summed = summed_over(equations, fit, equations.moment, place)
        acting = np.flatnonzero(fit.factors[:, list(place.recordings)].any(axis=(1, 2)))
        here = moments[:, list(place.recordings)][:, :, list(place.units.wheels)].sum(axis=2)
        for courses, begins in ((place.begins, True), (place.stands, False)):
            groups = [
                group
                for group in equations.groups
                if len(group.columns) == 1
                and group.begins == begins
                and may_share(group, place.units, len(equations.wheels))
            ]
            if not groups or not courses:
                continue
            at = [group.columns[0] for group in groups]
            signs = np.array([group.signs[0] for group in groups])
            penalties = np.array([penalty(equations, FleetTerm(g, place.units, courses[-1])) for g in groups])
            for course in courses:
                by = course.factors(place.recordings, equations.when)
                cross = np.einsum("jic,i->jc", summed.cross[:, :, at], by)
                own = by**2 @ np.diagonal(summed.own, axis1=1, axis2=2)[:, at]
                moment = np.einsum("dic,i->dc", here[:, :, at], by) - fitted[:, acting] @ cross
                complement = schur_diagonal(own, cross, summed.inverse)
                gain = delta_chi2_of_each(moment, complement, own, signs, THRESHOLDS.least_tolerance)
                costs = penalties + course_cost(course) - course_cost(courses[-1])
                largest = np.maximum(largest, np.max(gain - costs, axis=1))
    return largest
