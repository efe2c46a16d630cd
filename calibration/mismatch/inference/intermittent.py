"""A residual that is skewed: something comes and goes, which no law of a covariate describes.

Noise is as often above its mean as below, however slowly it varies. A cable that rubs now and then, a valve that sticks
three times, or an hour of tail wind adds to one side alone: most readings have none of it, and some have much. Its mean
resembles a constant friction or offset; its spells lengthen the noise's memory, in which they would be lost. They show
in the mean over about their length, where the noise is smaller and they are not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.signal.noise import significant_autocorrelation
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

CONSTANT = frozenset({"direction", "none"})
"""Covariates of effects of constant size."""


def unexplained_if_intermittent(decision: Decision) -> Decision:
    """Return the decision with a curve over time unexplained on each wheel whose residual is skewed.

    An effect of constant size that was named there is the mean of what comes and goes, and loses its name.
    """
    equations = decision.equations
    explained = {wheel for term in decision.unnamed for wheel in term.wheels}
    wheels = [wheel for wheel in skewed_wheels(decision) if wheel not in explained]
    curves = _curves_over_time(decision, wheels) if wheels else ()
    if not curves:
        return decision
    told = {wheel for term in curves for wheel in term.wheels}
    named = equations.fit([term for term in decision.named.terms if not _constant_on(term, told)])
    unnamed = (*decision.unnamed, *curves)
    whole = equations.fit((*named.terms, *unnamed))
    return replace(decision, named=named, unnamed=unnamed, whole=whole, intermittent=tuple(curves))


def skewed_wheels(decision: Decision) -> list[int]:
    """Return the wheels on which what is left, as read or along the motion, has more skewness than noise by chance."""
    equations, problem = decision.equations, decision.equations.problem
    left = residual_of(equations, decision.whole)
    explained = np.zeros(left.shape)
    for index in range(len(decision.named.terms)):
        explained += contribution(equations, decision.named, index)
    along = np.nan_to_num(problem.covariates.get("direction", np.ones(left.shape)))
    found = []
    for wheel in range(left.shape[1]):
        here = problem.mask[:, wheel]
        moving = here & (along[:, wheel] != 0)
        for course, by in ((here, 1.0), (moving, along[moving, wheel])):
            if is_skewed(left[course, wheel] * by, explained[course, wheel] * by, equations.thresholds):
                found.append(wheel)
                break
    return found


def is_skewed(left: Array, explained: Array, thresholds: Thresholds = THRESHOLDS) -> bool:
    """Return whether running means of what is left (time,), of any length, are skewed by more than chance.

    Means that are small against those of what the named effects explain are the misfit of laws, of any distribution.
    """
    fewest = thresholds.fewest_means
    courses = (_running_means(course, fewest) for course in (_without_single(left), explained))
    for means, beside in zip(*courses, strict=False):
        skewness, error = skewness_of(means, thresholds)
        large = np.sum(means**2) > thresholds.form_misfit * np.sum(beside**2)
        if large and abs(skewness) > max(thresholds.least_skewness, thresholds.most_skewness_errors * error):
            return True
    return False


def _running_means(values: Array, fewest: int) -> Iterator[Array]:
    """Yield a course's running means over 1, 2, 4, … readings, as long as so many of them do not overlap."""
    total, length = np.concatenate(([0.0], np.cumsum(values))), 1
    while fewest * length <= len(values):
        yield (total[length:] - total[:-length]) / length
        length *= 2


def skewness_of(values: Array, thresholds: Thresholds = THRESHOLDS) -> tuple[float, float]:
    """Return the skewness of a course (time,), and its standard error where it is normal and autocorrelated.

    The variance is 6/n (1 + 2 Σ ρ³) (Lomnicki, 1961); the sum is over the lags that are significant.
    """
    count = len(values)
    deviations = values - values.mean() if count else values
    std = float(np.std(deviations)) if count else 0.0
    if std == 0.0:
        return 0.0, float("inf")
    scaled = (deviations / std)[:, None]
    correlation = significant_autocorrelation(scaled, np.ones(scaled.shape, bool), thresholds)
    variance = 6 / count * (1 + 2 * float(np.sum(correlation**3)))
    return float(np.mean(deviations**3)) / std**3, variance**0.5


def _without_single(values: Array) -> Array:
    """Return the running median of three: a single reading that is off is a fault of its sensor."""
    if len(values) < 3:
        return values
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(values, 3), axis=-1))


def _curves_over_time(decision: Decision, wheels: list[int]) -> tuple[Term, ...]:
    """Return the best curve over time on each of these wheels alone, where it has one."""
    best = best_of_each_smooth_term(decision.equations, decision.named.terms)
    curves = {term.wheels: term for _, term in reversed(best) if term.name == "time"}
    return tuple(curves[(wheel,)] for wheel in wheels if (wheel,) in curves)


def _constant_on(term: Term, wheels: set[int]) -> bool:
    """Return whether a named effect is of constant size on one of these wheels."""
    candidate = term.group.candidate
    return candidate is not None and candidate.covariate in CONSTANT and bool(wheels.intersection(term.wheels))
