"""Covariates that follow the noise of the predicted reading, as the output of a controller that acts on it does.

The residual then follows such a covariate though nothing is missing. What a covariate's own past predicts of it knows
nothing of the noise that comes now: physics follows that part as well as the rest, and feedback follows the rest alone
(the test of endogeneity by Durbin, 1954, Wu, 1973, and Hausman, 1978, with the covariate's past as its instrument).

Free parameters take up most of what is slow in a curve, physics or not. So each part is compared with the residual
beside them: less what they take up of it. Curves over other covariates take no part. Beside a covariate that follows
the noise there often is another that balances the slow part of its curve, and with it that part would seem confirmed.

Where a recording has few changes of a covariate that its past predicts, neither is refuted. Then it counts whether the
noise leads the covariate (Granger, 1969).
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.statements import capital
from regolithd.calibration.mismatch.inference.uncertainty.sandwich import block_sums
from regolithd.calibration.mismatch.problem.covariates import FOLLOW_SPEED
from regolithd.calibration.mismatch.problem.words import word_for
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.groups.smooth_groups import same_course
from regolithd.calibration.mismatch.regression.likelihood.as_read import left_beside
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.cross_validation import training_equations
from regolithd.calibration.mismatch.signal.chi_squared import quantile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OF_MOTION = frozenset({*FOLLOW_SPEED, "wheel_speed", "place", "time", "torque"})
"""Covariates that no controller sets from the predicted reading alone: what is quick in them is physics."""
OLDER, NEWER, LAGS = 8, 2, 8
"""The latest reading of the past, the latest that noise remembers, and how many readings predict. (Choices: in
strangers' trials the slope with the past of a controller's output fell from 0.3 of that with what is new at two
readings to 0.1 at eight; that of curves of physics stayed at 0.7 to 1.1 from two readings to twelve.)"""
FORGOTTEN, LONGEST_MEMORY = 0.1, 64
"""Autocorrelation of what is left below which the noise is forgotten, and readings that it lasts at most. (Choices: a
tenth of the slope with what is new; what lasts longer is no noise, but what a curve over it would explain.)"""
GRANGER_LAGS, GRANGER_LEVEL = 4, 1e-4
"""Readings of noise by which a covariate is predicted, and the probability by chance from which they help (choices)."""
FEWEST_FOR_EACH = 10
"""Readings for each number that predicts a covariate, at least (a choice: chance adds a tenth of what is left)."""
REFUTED = 9.0
"""χ² from which a covariate that the noise leads is not only fed back: three standard deviations of the slope with its
past."""
LEAST_LEAD = 6.0
"""Lead, in χ², of feedback over physics from which a covariate follows the noise (a choice: e³ to one. Of curves over
the outputs of a stranger's controllers five of six have 8 to 68; six of physics have −1200 to −19, and one over a load
that jumps, of which the past predicts little, 4.)"""


def fed_back(decision: Decision) -> frozenset[str]:
    """Return the covariates of its curves that the residual follows only in what is new of them."""
    names = {term.name for term in decision.unnamed if term.name not in OF_MOTION and not term.group.later}
    return frozenset(name for name in names if not decision.intermittent and _is_fed_back(decision, name))


def notes_of_feedback(problem: Problem) -> tuple[str, ...]:
    """Return a note for each covariate that has no curve because it follows the reading's noise."""
    return tuple(
        f"{capital(word_for(covariate, problem.labels))} follows the noise of the reading of "
        f"{problem.simulation.channel}, {_why_fed_back(problem, covariate)}. What else would act by quick changes of "
        f"it alone cannot be told apart from that: hold it still, or record another sensor."
        for covariate in sorted(problem.fed_back)
    )


def _why_fed_back(problem: Problem, covariate: str) -> str:
    """Return what a covariate is that follows a reading's noise: an input whose own error is a part of that, or not."""
    values, inputs = problem.covariates[covariate], problem.smoothed
    if any(same_course(values, inputs[name], problem.mask) for name in inputs if name != problem.simulation.channel):
        return "as an input does whose own error is a part of that noise"
    return "as the output of a controller that acts on that reading does"


def _is_fed_back(decision: Decision, covariate: str) -> bool:
    """Return whether the residual follows a covariate's curves in what its past does not predict, and hardly else."""
    equations, whole = decision.equations, decision.whole
    over = [k for k, term in enumerate(whole.terms) if term.name == covariate and not term.group.named]
    named = equations.fit([term for term in whole.terms if term.group.named])
    curve = _as_others_fitted(equations, whole, over)
    left = residual_of(equations, named)
    past, known = _predicted(equations.problem, curve, max(OLDER, _memory(equations.problem, left)))
    remembered, _ = _predicted(equations.problem, curve, NEWER)
    parts = np.where(known, np.stack((past, remembered - past, curve - remembered)), 0.0)
    parts = np.where(known, left_beside(equations, named, parts), 0.0)
    left = np.where(known, left, 0.0)
    blocks = blocks_of_time(equations.problem, decision.noise)
    if not known.any():
        return False
    physics, feedback = _chi_squared(parts, left, blocks)
    if physics - feedback > LEAST_LEAD:
        return True
    return feedback < REFUTED and _is_granger_caused(equations.problem, covariate, curve, residual_of(equations, whole))


def _as_others_fitted(equations: NormalEquations, whole: Fit, over: Sequence[int]) -> Array:
    """Return what some terms of a fit add [time, wheel], on each fold as the other folds have fitted them.

    Noise that lasts is as slow as what the past predicts of a curve: that would follow the readings it was fitted to.
    """
    design, found = equations.design, np.zeros(equations.problem.mask.shape)
    for fold, (first, last) in enumerate(pairwise(design.cuts)):
        train = training_equations(equations, fold).fit(whole.terms)
        rows = design.order[first:last]
        found[rows] = sum((contribution(equations, train, k)[rows] for k in over), np.zeros(()))
    return found


def _memory(problem: Problem, left: Array) -> int:
    """Return after how many readings what is left [time, wheel] is forgotten: noise that lasts is fed back as long."""
    at = [left[rows[run], wheel] for wheel, (rows, runs) in enumerate(problem.courses) for run in runs]
    power = sum(float(np.sum(each**2)) for each in at)
    for lag in range(1, LONGEST_MEMORY):
        if sum(float(np.sum(each[lag:] * each[:-lag])) for each in at) < FORGOTTEN * power:
            return lag
    return LONGEST_MEMORY


def _predicted(problem: Problem, curve: Array, newest: int) -> tuple[Array, Mask]:
    """Return what a curve's past up to so many readings ago predicts of it [time, wheel], and where there is enough."""
    found, known = np.zeros(curve.shape), np.zeros(curve.shape, np.bool_)
    at = [(rows[run], wheel) for wheel, (rows, runs) in enumerate(problem.courses) for run in runs]
    at = [(rows, wheel) for rows, wheel in at if len(rows) > newest + LAGS and curve[rows, wheel].any()]
    if at:
        before = [sliding_window_view(curve[each], LAGS)[1:-newest] for each in at]
        where = [(rows[newest + LAGS :], wheel) for rows, wheel in at]
        now = np.concatenate([curve[each] for each in where])
        weights = np.linalg.lstsq(np.concatenate(before), now, rcond=None)[0]
        for each, readings in zip(where, before, strict=True):
            found[each], known[each] = readings @ weights, True
    return found, known


def _is_granger_caused(problem: Problem, covariate: str, curve: Array, noise: Array) -> bool:
    """Return whether the noise [time, wheel] tells what a covariate does next beyond its own past (Granger, 1969).

    What nobody controls by the reading does not know the reading's noise. A controller's output has that noise in it,
    of which its `curve` [time, wheel] has a part: who knows both knows where the output was without.
    """
    values, at = problem.covariates[covariate], []
    for wheel, (rows, runs) in enumerate(problem.courses):
        at += [(rows[run], wheel) for run in runs if len(rows[run]) > LAGS]

    def past(of: Array, lags: int) -> Array:
        """Return so many readings before each that has all of them, shape (reading, lag)."""
        return np.concatenate([sliding_window_view(of[each], LAGS)[:-1, -lags:] for each in at])

    if not at:
        return False
    now = np.concatenate([values[rows[LAGS:], wheel] for rows, wheel in at])
    own = np.column_stack((past(values, LAGS), past(curve, GRANGER_LAGS), np.ones(len(now))))
    known = np.isfinite(now) & np.isfinite(own).all(axis=1)
    if known.sum() < FEWEST_FOR_EACH * (own.shape[1] + GRANGER_LAGS):
        return False
    without, with_noise = (
        float(np.sum((now[known] - columns @ np.linalg.lstsq(columns, now[known], rcond=None)[0]) ** 2))
        for columns in (own[known], np.column_stack((own, past(noise, GRANGER_LAGS)))[known])
    )
    return with_noise > 0 and int(known.sum()) * np.log(without / with_noise) > quantile(GRANGER_LAGS, GRANGER_LEVEL)


def _chi_squared(parts: Array, left: Array, blocks: NDArray[np.int64]) -> tuple[float, float]:
    """Return how far the slopes of what is left [time, wheel] with parts of a curve [part, time, wheel] are off.

    From those of physics, and from those of feedback. Feedback has no slope with the first part, whatever the others
    are. Physics has that of the last with all parts, or a larger one: a slope with the last above 1 counts as 1, since
    a smooth curve over a slow covariate has too little of what is quick.
    """
    inverse = np.linalg.pinv(np.einsum("atw,btw->ab", parts, parts))
    slopes = inverse @ np.einsum("atw,tw->a", parts, left)
    sums = block_sums(parts * (left - np.einsum("a,atw->tw", slopes, parts)), blocks)
    covariance = inverse @ (sums.T @ sums) @ inverse
    new = 1.0 if slopes[-1] > 1 else slopes[-1]
    below = [part for part in range(len(slopes) - 1) if slopes[part] < new]
    contrast = np.zeros((len(below), len(slopes)))
    contrast[range(len(below)), below] = -1.0
    contrast[:, -1] = 1.0 if slopes[-1] <= 1 else 0.0
    short = new - slopes[below]
    of_physics = float(short @ np.linalg.pinv(contrast @ covariance @ contrast.T) @ short)
    of_feedback = float(slopes[0] ** 2 / covariance[0, 0]) if covariance[0, 0] > 0 else 0.0
    return of_physics if slopes[0] < new else 0.0, of_feedback
