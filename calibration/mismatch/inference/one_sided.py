"""A residual that is skewed along the motion: something brakes now and then, which no law of a covariate describes.

Noise is as often above its mean as below. A cable that rubs now and then, or a stone in a wheel, adds to one side
alone: most readings have none of it, and some have much. Its mean resembles Coulomb friction, and its course is too
quick for a smooth term over time, so that it would pass for noise otherwise.
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
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

MOST_STANDARD_ERRORS = 6.0
"""Standard errors of the skewness beyond which a residual is one-sided. In 27 recordings of eight machines with
nothing, or what was found, left out, it was at most 3.5; with drag in spells of 20 % of the mean reading 9 to 13."""
LEAST_SKEWNESS = 0.5
"""Skewness below which it is no finding: a long recording shows that a law or a sensor is not quite linear. In the
demonstration it is −0.1 to −0.4 on the six wheels, with drag in spells 0.7 to 1.1. A drag is against the motion: what
is skewed the other way is none."""


def unexplained_if_one_sided(decision: Decision) -> Decision:
    """Return the decision with a curve over time unexplained on each wheel whose residual is skewed along the motion.

    A constant friction that was named there is the mean of what comes and goes, and loses its name.
    """
    equations = decision.equations
    explained = {wheel for term in decision.unnamed for wheel in term.wheels}
    wheels = [wheel for wheel in one_sided_wheels(decision) if wheel not in explained]
    curves = _curves_over_time(decision, wheels) if wheels else ()
    if not curves:
        return decision
    told = {wheel for term in curves for wheel in term.wheels}
    named = equations.fit([term for term in decision.named.terms if not _constant_friction_on(term, told)])
    unnamed = (*decision.unnamed, *curves)
    return replace(decision, named=named, unnamed=unnamed, whole=equations.fit((*named.terms, *unnamed)))


def one_sided_wheels(decision: Decision) -> list[int]:
    """Return the wheels on which what is left has more skewness along the motion than noise has by chance.

    What is small against the named effects there is the misfit of their laws, and has any distribution.
    """
    equations, problem = decision.equations, decision.equations.problem
    left = residual_of(equations, decision.whole)
    explained = np.zeros(left.shape)
    for index in range(len(decision.named.terms)):
        explained += contribution(equations, decision.named, index)
    misfit = equations.thresholds.form_misfit * np.sum(np.where(problem.mask, explained, 0.0) ** 2, axis=0)
    along = np.nan_to_num(problem.covariates.get("direction", np.ones(left.shape)))
    found = []
    for wheel in range(left.shape[1]):
        moving = problem.mask[:, wheel] & (along[:, wheel] != 0)
        skewness, error = skewness_of(_without_single(left[moving, wheel] * along[moving, wheel]), equations.thresholds)
        large = np.sum(left[problem.mask[:, wheel], wheel] ** 2) > misfit[wheel]
        if large and skewness > max(LEAST_SKEWNESS, MOST_STANDARD_ERRORS * error):
            found.append(wheel)
    return found


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


def _constant_friction_on(term: Term, wheels: set[int]) -> bool:
    """Return whether a named effect is a drag of constant size on one of these wheels."""
    candidate = term.group.candidate
    return candidate is not None and candidate.covariate == "direction" and bool(wheels.intersection(term.wheels))
