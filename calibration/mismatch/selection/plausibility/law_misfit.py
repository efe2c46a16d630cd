"""What effects explain as a whole, and how much of it their laws miss.

No law is exact to the last percent. A corrected effect that has changed is inexact by a share of its whole size, of
which the prediction has a part already. The delay of an input that is on time has no law to miss: the simulation runs
with that input.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.late_columns import SENSOR_DELAY
from regolithd.calibration.mismatch.problem.covariates import names_of_prediction
from regolithd.calibration.mismatch.regression.groups.lagged_groups import LAGGED
from regolithd.calibration.mismatch.regression.normal_equations import SINGULAR
from regolithd.calibration.mismatch.regression.nuisance import EXACT
from regolithd.calibration.mismatch.regression.screening.schur import held_by_last

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def law_misfit(equations: NormalEquations, names: Fit, with_curve: Fit) -> float:
    """Return the share of Δχ² that a curve adds to names, or has in their place."""
    gain = with_curve.delta_chi2 - names.delta_chi2
    return gain / max(explained(equations, names) + gain, 1e-9)


def misfit_beside(equations: NormalEquations, names: Fit, with_curve: Fit) -> float:
    """Return the share of Δχ² that a curve adds to names, those of delays as far as the curve can hold what they leave.

    The curve is the last term.
    """
    gain = with_curve.delta_chi2 - names.delta_chi2
    return gain / max(explained_beside(equations, names, with_curve.terms[-1:]) + gain, 1e-9)


def explained_beside(equations: NormalEquations, names: Fit, further: Sequence[Term]) -> float:
    """Return the Δχ² of names of which further terms can hold a share as their misfit.

    What an inexact law leaves is a function of its covariate: a further law over that, over the prediction, or of
    nothing (a constant, a delay) can hold it all. One over another covariate holds as much of it as of the law itself,
    beside the parameters: a ripple over the angle hardly anything of a drag. A curve has knots enough to hold what laws
    miss over covariates that go with its own, but for delays: these change something wherever the prediction does, of
    which a curve over the sun's azimuth holds hardly anything.
    """
    over = {term.imitated_over for term in further}
    changed = any(term.group.is_change for term in names.terms)
    if changed or "none" in over or any(is_of_the_prediction(equations.problem, term) for term in further):
        return explained(equations, names)
    of_laws = all(term.group.named for term in further)
    partly = [
        index
        for index, term in enumerate(names.terms)
        if term.name == SENSOR_DELAY or (of_laws and term.imitated_over not in over)
    ]
    if not partly:
        return explained(equations, names)
    others = equations.fit([term for index, term in enumerate(names.terms) if index not in partly])
    by_these = names.delta_chi2 - others.delta_chi2
    size = np.zeros(len(names.columns))
    for index in partly:
        size[names.of_term(index)] = names.coefficients[names.of_term(index)]
    matrix, first = equations.normal_matrix((*names.terms, *further)), len(equations.nuisance.columns)
    held = min(held_by_last(matrix, first, len(size), size[first:], SINGULAR), by_these)
    return explained(equations, names) - by_these + held


def is_of_the_prediction(problem: Problem, term: Term) -> bool:
    """Return whether a term is over the size of the prediction, or over its past."""
    return term.imitated_over in {*names_of_prediction(problem.simulation.channel)} | LAGGED


def as_stated(equations: NormalEquations) -> NormalEquations:
    """Return the equations in which corrected effects are as the simulation has them, as if they were known exactly."""
    held = equations.nuisance
    for place, name in enumerate(held.names):
        held = held.with_precision(place, EXACT) if name in held.stated else held
    return equations.with_nuisance(held)


def without_terms(equations: NormalEquations, terms: Sequence[Term], rest: Sequence[Term]) -> Fit:
    """Return the fit of the others that the gain of terms on held-out readings is measured against.

    That of a change is measured against the corrected effect as it was: what is uncertain of that would take the change
    up, and be as good on any reading.
    """
    changed = any(term.group.is_change for term in terms)
    return (as_stated(equations) if changed else equations).fit(rest)


def settled(equations: NormalEquations, fit: Fit) -> Fit:
    """Return the fit of those terms alone by which an input is late that the problem has on time."""
    return equations.fit([term for term in fit.terms if term.settled_in(equations.problem)])


def explained(equations: NormalEquations, fit: Fit) -> float:
    """Return the Δχ² of a fit's laws, with what is in the prediction already of corrected effects that it changes."""
    sizes = [term.group.candidate.stated_size if term.group.candidate else 0.0 for term in fit.terms]
    total = fit.delta_chi2 - settled(equations, fit).delta_chi2
    if not any(sizes):
        return total
    held = as_stated(equations)
    for index, (term, size) in enumerate(zip(fit.terms, sizes, strict=True)):
        if not size:
            continue
        change = fit.coefficients[fit.of_term(index)]
        now = change + size * equations.design.scale[list(term.group.columns)]
        _, energy = held.own_and_complement(fit.without(index), term)
        total += max(float(now @ energy @ now - change @ energy @ change), 0.0)
    return total
