"""What a term gains where the noise may have any spectrum, and be as slow as the term is.

The weights of the equations are those of the noise beside what was found. Where the noise is slow, a curve that follows
it gains by the weights what it does not gain in likelihood: a slow spectrum explains as much.
"""

from __future__ import annotations

from math import inf, log
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.regression.likelihood.as_read import columns_on_wheels
from regolithd.calibration.mismatch.regression.likelihood.restricted_likelihood import (
    FEWEST_READINGS,
    GivenColumns,
    Priors,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]

RIVALS = 3
"""Curves over other covariates that are asked in noise of any spectrum, best first (a choice)."""
FEWEST_KNOTS = 4
"""Knots from which a curve has a course that may be smooth (a choice)."""


def score_beside_slow_noise(equations: NormalEquations, rest: Sequence[Term], terms: Sequence[Term]) -> float:
    """Return what terms gain beside others in twice the log likelihood of noise of any spectrum, less their penalties.

    The free parameters are fitted with them, held by their priors: where the weights know slow noise badly, it bends
    these. Where no wheel has readings enough for a spectrum, it is what the terms gain by the weights.
    """
    read = [places for places, _ in equations.design.readings]
    if max((len(places) for places in read), default=0) < FEWEST_READINGS:
        return equations.score(equations.fit((*rest, *terms))) - equations.score(equations.fit(rest))
    given = equations.lately(_given, rest)
    own = _weighed(
        equations, columns_on_wheels(equations, equations.columns_of(terms)[len(equations.nuisance.columns) :])
    )
    further = given.with_further([own[:, wheel, places] for wheel, places in enumerate(read)])
    gain, penalty = further.gain(), sum(equations.penalty(term) for term in terms)
    if (roughness := _roughness(equations, terms)) is not None:
        smooth, free = further.gain_if_smooth(roughness)
        gain = max(gain, smooth + equations.thresholds.coefficient_penalty * (len(roughness) - free))
    return gain - penalty


def _given(equations: NormalEquations, terms: Sequence[Term]) -> GivenColumns:
    """Return the free parameters and terms as what is fitted anyway to the readings of each wheel."""
    design, nuisance = equations.design, equations.nuisance
    columns = _weighed(equations, columns_on_wheels(equations, equations.columns_of(terms)))
    residual = _weighed(equations, design.residual_as_read.astype(np.float64))
    return GivenColumns(
        [residual[wheel, places] for wheel, (places, _) in enumerate(design.readings)],
        [columns[:, wheel, places] for wheel, (places, _) in enumerate(design.readings)],
        Priors(nuisance.precision, nuisance.centre),
        equations.thresholds,
    )


def _weighed(equations: NormalEquations, series: Array) -> Array:
    """Return series (…, wheel, time by folds) multiplied by what makes readings scatter alike, each by itself.

    How little a mean of many tells, where errors last, is a matter of the spectrum.
    """
    reliability = equations.design.reliability
    return series if reliability is None else series * reliability.alone


def _roughness(equations: NormalEquations, terms: Sequence[Term]) -> Array | None:
    """Return the sum of squares of the second differences along curves, as a matrix of the terms' scaled coefficients.

    0 for those of what is no curve. None, where there is no curve.
    """
    total, end = sum(len(term.group.columns) for term in terms), 0
    found = np.zeros((total, total))
    for term in terms:
        group, begin = term.group, end
        end += len(group.columns)
        is_curve = not group.named and group.region is None and group.coupling not in WITHOUT_CURVE
        if is_curve and len(group.columns) >= FEWEST_KNOTS:
            second = np.diff(np.eye(end - begin), 2, axis=0) / equations.design.scale[list(group.columns)]
            found[begin:end, begin:end] = second.T @ second
    return found if found.any() else None


def lead_beside_slow_noise(equations: NormalEquations, ahead: Sequence[Term], behind: Sequence[Term]) -> float:
    """Return by how much some terms score more than others in noise of any spectrum, without those that both have."""
    shared, *further = apart(ahead, behind)
    of_ahead, of_behind = (score_beside_slow_noise(equations, shared, terms) if terms else 0.0 for terms in further)
    return of_ahead - of_behind


def apart(one: Sequence[Term], other: Sequence[Term]) -> tuple[tuple[Term, ...], tuple[Term, ...], tuple[Term, ...]]:
    """Return the terms that both have, and the further terms of either."""
    shared = tuple(term for term in one if any(term is each for each in other))
    of_one, of_other = (
        tuple(term for term in terms if not any(term is each for each in shared)) for terms in (one, other)
    )
    return shared, of_one, of_other


def best_curve(equations: NormalEquations, given: Sequence[Term], curves: Sequence[tuple[float, Term]]) -> Term | None:
    """Return the significant curve that scores most of those that slow noise and the inputs' errors do not explain.

    None, if there is none.

    In place of one over time, it is one over another covariate that is more probable (`_over_another_covariate`).

    Parameters
    ----------
    given: terms that the curve stands beside
    curves: with their scores by the weights, best first
    """
    limits = equations.thresholds
    for score, curve in curves:
        if score <= limits.smooth_term_entry:
            break
        if score <= limits.smooth_term_entry + equations.needed_beside_errors(given, curve):
            continue
        if score_beside_slow_noise(equations, given, [curve]) > limits.slow_noise_entry:
            return _over_another_covariate(equations, given, (score, curve), curves)
    return None


def _over_another_covariate(
    equations: NormalEquations, given: Sequence[Term], best: tuple[float, Term], curves: Sequence[tuple[float, Term]]
) -> Term:
    """Return a curve, or, in place of one over time, one that explains nearly as much and is more probable.

    A curve over time has knots enough to follow whatever changes slowly. By Schwarz's criterion each of them costs the
    logarithm of the number of readings. Of what the other curve explains, the share that an inexact law may lack
    (`form_misfit`) is no objection: its knots are few. Noise of any spectrum does not explain it either. What slow
    noise explains of the curve over time is no evidence for the time: one of the next such curves that is clearly ahead
    in noise of any spectrum, by as much as a curve must score, is told whatever its knots cost.
    """
    limits, (score, curve) = equations.thresholds, best
    if curve.name != "time":
        return curve
    readings = sum(len(equations.design.readings[wheel][0]) for wheel in curve.wheels)
    further = log(readings) - limits.coefficient_penalty

    def evidence(score: float, term: Term) -> float:
        return score - further * len(term.group.columns)

    near = [
        (each, term)
        for each, term in curves
        if term.wheels == curve.wheels and each >= (1 - limits.form_misfit) * score
    ]
    rivals = [(evidence(each, term), term) for each, term in near if term.group.coupling not in WITHOUT_CURVE]
    most, other = max(rivals, key=lambda pair: pair[0], default=(-inf, curve))
    if most > evidence(score, curve) and score_beside_slow_noise(equations, given, [other]) > limits.slow_noise_entry:
        return other
    others = [term for _, term in near if term.name != "time"][:RIVALS]
    in_slow_noise = [(score_beside_slow_noise(equations, given, [term]), term) for term in others]
    most, other = max(in_slow_noise, key=lambda pair: pair[0], default=(-inf, curve))
    ahead = most > -inf and most > score_beside_slow_noise(equations, given, [curve]) + limits.smooth_term_entry
    return other if ahead else curve
