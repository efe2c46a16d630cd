"""The noise of a residual that still has structure in it: terms are taken out before the noise is estimated.

An effect that is left in makes the noise larger and its autocorrelation time longer, and is then insignificant itself.
So the most significant terms are taken out first, under a short autocorrelation time, whether they are significant or
not: their few coefficients hardly lower the estimate. Then, with that noise, only what is significant is taken out, and
of that only what makes the rest likelier as noise of any spectrum.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import known_mean
from regolithd.calibration.mismatch.regression.likelihood.reliability import reliability_of
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.plausibility.causality import acts_forwards
from regolithd.calibration.mismatch.selection.slow_noise import score_beside_slow_noise
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
from regolithd.calibration.mismatch.signal.noise_models.whitening import estimate_whitening

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]


def fit_of_significant_terms(equations: NormalEquations) -> Fit:
    """Return the fit of all that explains something, with the free parameters: what it leaves is the noise."""
    limits = equations.thresholds
    first = _noise_beside(equations, ())
    short = min(first.autocorrelation_time, limits.provisional_autocorrelation_time)
    provisional = equations.weighted(NoiseModel(first.deviation, short).weights)
    second = _noise_beside(provisional, _most_significant(provisional, limits.provisional_terms, -np.inf))
    # Of all wheels together: an effect that is still in one wheel's residual would hide in that wheel's own time.
    weighted = equations.weighted(NoiseModel(second.deviation, second.autocorrelation_time).weights)
    return weighted.fit(_beyond_slow_noise(weighted))


def noise_left(equations: NormalEquations) -> Array:
    """Return the residual [time, wheel] of the significant terms, parameters being as far off as any is told to be.

    What a wrong parameter leaves is no noise, whoever states how well it is known.
    """
    terms, nuisance = fit_of_significant_terms(equations).terms, equations.nuisance
    wide = nuisance.widened(nuisance.told(equations.problem), equations.problem)
    free = equations.with_nuisance(wide)
    return _about_its_mean(free, residual_of(free, free.fit(terms)))


def _beyond_slow_noise(equations: NormalEquations) -> list[Term]:
    """Return the terms that are significant, and without which what is left is less likely noise of any spectrum.

    Under a short autocorrelation time slow noise is significant, and a curve that follows it would be taken out of it.
    The worst term is left out first, and others are asked in its place: of a law that changes slowly, a curve over time
    explains more with many coefficients, and in slow noise the law itself more with one.
    """
    limits = equations.thresholds
    refused: set[str] = set()
    kept: list[Term] = []
    least_score = limits.noise_term_share * limits.smooth_term_entry
    while True:
        more = _most_significant(equations, 2 * limits.provisional_terms, least_score, kept, refused)
        if len(more) == len(kept):
            return kept
        kept = more
        while kept:
            scores = [
                score_beside_slow_noise(equations, [*kept[:index], *kept[index + 1 :]], [term])
                for index, term in enumerate(kept)
            ]
            worst = int(np.argmin(scores))
            if scores[worst] > 0:
                break
            refused.add(kept[worst].name)
            del kept[worst]


def whitened(equations: NormalEquations, residual: Array) -> NormalEquations:
    """Return the equations whitened by the noise of a residual [time, wheel], readings in doubt weighing less."""
    design, courses = equations.design, []
    reliability, values = reliability_of(design, residual), design.in_folds(residual)
    values = values if reliability is None else values * reliability.in_means
    for (places, runs), of_wheel in zip(design.readings, values, strict=True):
        deviation = float(np.sqrt(np.mean(of_wheel[places] ** 2))) if len(places) else 0.0
        if deviation > 0:
            courses.append((of_wheel[places] / deviation, runs))
    equations = equations.whitened(estimate_whitening(courses, equations.thresholds), equations.weights, reliability)
    return equations.weighted(noise_of_whitened(equations.design, residual).weights)


def noise_of_whitened(design: DesignMatrix, residual: Array) -> NoiseModel:
    """Return the noise of a residual [time, wheel] once it is whitened."""
    return design.problem.noise_of(design.whitened_in_time(residual))


def _noise_beside(equations: NormalEquations, terms: Sequence[Term]) -> NoiseModel:
    """Return the noise of what these terms leave."""
    left = _about_its_mean(equations, residual_of(equations, equations.fit(terms)))
    return noise_of_whitened(equations.design, left)


def _about_its_mean(equations: NormalEquations, residual: Array) -> Array:
    """Return a residual [time, wheel] less the mean of each wheel: an offset is no noise, however slow noise may be."""
    mask = equations.problem.mask
    return residual - np.where(mask, known_mean(np.where(mask, residual, np.nan)), 0.0)


def _most_significant(
    equations: NormalEquations,
    most: int,
    least_score: float,
    begin: Sequence[Term] = (),
    without: Collection[str] = (),
) -> list[Term]:
    """Return up to `most` terms by forward selection, as long as each scores more than `least_score`.

    `begin` are those that are there already, `without` are names and covariates that are not asked. Smooth terms with
    many columns are left out: they follow the noise itself.
    """
    columns = equations.thresholds.noise_term_columns
    limited = [
        group for group in equations.design.groups if len(group.columns) <= columns and group.name not in without
    ]
    terms = list(begin)
    while len(terms) < most:
        found = equations.gains(terms, limited).largest_score()
        if found is None or found[0] <= least_score:
            break
        if acts_forwards(equations, terms, found[1]):
            terms.append(found[1])
        else:
            limited = [group for group in limited if group is not found[1].group]
    return terms
