"""Covariates that follow the noise of the predicted reading, as the output of a controller that acts on it does.

The residual then follows such a covariate though nothing is missing. What a covariate's own past predicts of it knows
nothing of the noise that comes now: physics follows that part as well as the rest, and feedback follows the rest alone
(the test of endogeneity by Durbin, 1954, Wu, 1973, and Hausman, 1978, with the covariate's past as its instrument).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.sandwich import block_sums
from regolithd.calibration.mismatch.inference.statements import capital
from regolithd.calibration.mismatch.problem.covariates import FOLLOW_SPEED
from regolithd.calibration.mismatch.problem.words import word_for
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.decision import names_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OF_MOTION = frozenset({*FOLLOW_SPEED, "wheel_speed", "place", "time", "torque"})
"""Covariates that no controller sets from the predicted reading alone: what is quick in them is physics."""
NEWEST, LAGS = 2, 8
"""The latest reading of the past, and how many are taken (a choice: noise may have a memory of a reading)."""
LEAST_STDS = 4.0
"""Standard deviations by which the residual follows what is new more than the past (a choice)."""
MOST_STDS_OF_PAST = 2.5
"""Standard deviations by which it follows the past at most (a choice: where parameters take up slow parts of physics,
the rest follows the past by 6 to 9 of them)."""
LEAST_OF_PAST = 1 / 3
"""Slope with the past, as a share of that with what is new, from which on it is physics (a choice: in strangers'
trials curves of physics had 0.4 to 1.5 of it, those of a controller's output 0 to 0.3)."""


def without_feedback(decision: Decision) -> Decision:
    """Return the decision without curves that the residual follows only in what is new of them, with notes."""
    if decision.intermittent:
        return decision
    problem = decision.equations.problem
    names = dict.fromkeys(term.name for term in decision.unnamed if term.name not in OF_MOTION)
    fed = [covariate for covariate in names if _is_fed_back(decision, covariate)]
    if not fed:
        return decision
    kept = _still_there(decision, [term for term in decision.unnamed if term.name not in fed])
    notes = tuple(
        f"{capital(word_for(covariate, problem.labels))} follows the noise of the reading of "
        f"{problem.simulation.channel}, as the output of a controller that acts on that reading does. What else would "
        f"act by quick changes of it alone cannot be told apart from that: hold it still, or record another sensor."
        for covariate in fed
    )
    return replace(
        decision,
        unnamed=kept,
        whole=decision.equations.fit((*decision.named.terms, *kept)),
        refused=decision.refused | {names_of(decision)},
        notes=(*decision.notes, *notes),
    )


def _still_there(decision: Decision, curves: Sequence[Term]) -> tuple[Term, ...]:
    """Return the curves that score enough beside the named effects alone: they were chosen beside those that go."""
    equations, named = decision.equations, decision.named
    least = equations.score(named) + equations.thresholds.smooth_term_entry
    return tuple(curve for curve in curves if equations.score(equations.fit((*named.terms, curve))) > least)


def _is_fed_back(decision: Decision, covariate: str) -> bool:
    """Return whether the residual follows a covariate's curves in what its past does not predict, and hardly else."""
    equations, whole = decision.equations, decision.whole
    over = [k for k, term in enumerate(whole.terms) if term.name == covariate and not term.group.named]
    others = equations.fit([term for k, term in enumerate(whole.terms) if k not in over])
    curve = sum((contribution(equations, whole, k) for k in over), np.zeros(equations.problem.mask.shape))
    past, known = _by_its_past(equations.problem, curve)
    new, left = (np.where(known, values, 0.0) for values in (curve - past, residual_of(equations, others)))
    blocks = blocks_of_time(equations.problem, decision.noise)
    return bool(known.any()) and _follows_the_new_alone(np.stack((past, new)), left, blocks)


def _by_its_past(problem: Problem, curve: Array) -> tuple[Array, Mask]:
    """Return what a curve's own past predicts of it, shape (time, wheel), and where there is enough of that; else 0."""
    past, known = np.zeros(curve.shape), np.zeros(curve.shape, np.bool_)
    at = [(rows[run], wheel) for wheel, (rows, runs) in enumerate(problem.courses) for run in runs]
    at = [(rows, wheel) for rows, wheel in at if len(rows) > NEWEST + LAGS and curve[rows, wheel].any()]
    if at:
        before = [sliding_window_view(curve[each], LAGS)[1:-NEWEST] for each in at]
        where = [(rows[NEWEST + LAGS :], wheel) for rows, wheel in at]
        now = np.concatenate([curve[each] for each in where])
        weights = np.linalg.lstsq(np.concatenate(before), now, rcond=None)[0]
        for each, readings in zip(where, before, strict=True):
            past[each], known[each] = readings @ weights, True
    return past, known


def _follows_the_new_alone(parts: Array, left: Array, blocks: NDArray[np.int64]) -> bool:
    """Return whether what is left [time, wheel] follows the second of two parts [part, time, wheel] alone."""
    inverse = np.linalg.pinv(np.einsum("atw,btw->ab", parts, parts))
    slopes = inverse @ np.einsum("atw,tw->a", parts, left)
    sums = block_sums(parts * (left - np.einsum("a,atw->tw", slopes, parts)), blocks)
    covariance = inverse @ (sums.T @ sums) @ inverse
    apart, spread = slopes[1] - slopes[0], np.sqrt(covariance[0, 0] + covariance[1, 1] - 2 * covariance[0, 1])
    past_std = float(np.sqrt(covariance[0, 0]))
    hardly = slopes[0] < min(LEAST_OF_PAST * slopes[1], MOST_STDS_OF_PAST * past_std)
    return bool(hardly and apart > LEAST_STDS * spread)
