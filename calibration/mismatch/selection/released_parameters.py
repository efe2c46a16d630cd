"""Parameters that were stated wrongly, against smooth terms and names: a value beyond its prior explains more.

The prior of a parameter holds as long as its statement is right. Where the readings contradict it, it would bias the
parameter, and a curve or a name beside it is paid twice: for what it fits, and for every deviation that the parameter
need not go then. So the prior is widened; if the parameter is all that is wrong, nothing significant is left beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.regression.residuals import chi2_of
from regolithd.calibration.mismatch.selection.best_subsets import entry_cost
from regolithd.calibration.mismatch.selection.smooth_terms import unexplained_beside

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

    Fitted = tuple[NormalEquations, Fit]

WRONG_STATEMENT_PENALTY = 9.2
"""Δχ² charged for a parameter that was stated wrongly: odds of one in a hundred before the recording, 2 ln 100."""


def released(equations: NormalEquations, named: Fit, whole: Fit, entry_threshold: float) -> Fitted | None:
    """Return equations with the priors of those parameters widened that the readings contradict, and the names' fit.

    Of parameters that could stand for each other the one whose release has most evidence is released, or all together;
    in the place of a name, where it is ahead of that by more than chance (`lead_margin`).
    None where the readings contradict none, where one would go further than a wrong statement explains
    (`furthest_linearisation_stds`), where something stays unexplained all the same, or where the evidence of `whole`,
    names and curves within the priors, is larger.
    """
    lead = equations.thresholds.lead_margin
    best, most = None, _evidence(equations, whole, (), entry_threshold)
    for kept in (named.terms, *(named.without(index) for index in range(len(named.terms)))):
        least = lead * (len(named.terms) - len(kept))
        for freed, places in _releases(equations, kept):
            fit = freed.fit(kept)
            evidence = _evidence(equations, fit, places, entry_threshold) - least
            if evidence >= most and _is_all_that_is_wrong(equations, freed, fit, places):
                best, most = (freed, fit), evidence
    return best


def _releases(equations: NormalEquations, kept: Sequence[Term]) -> Iterator[tuple[NormalEquations, tuple[int, ...]]]:
    """Yield equations with each contradicted parameter's prior widened, then with all, and these parameters' places."""
    contradicted = equations.nuisance.contradicting_their_priors(equations.fit(kept), equations.problem).tolist()
    for places in dict.fromkeys([*((place,) for place in contradicted), tuple(contradicted)]):
        if places:
            yield _with_wide_priors(equations, places), places


def _with_wide_priors(equations: NormalEquations, places: Sequence[int]) -> NormalEquations:
    """Return equations with these parameters' priors widened as far as a wrong statement goes."""
    wider = equations.nuisance
    for place in places:
        wide = float(wider.precision[place]) / _reach(equations, place) ** 2
        wider = wider.with_precision(place, wide)
    return equations.with_nuisance(wider)


def _reach(equations: NormalEquations, place: int) -> float:
    """Return how far one of the simulation's own parameters may be off [standard deviations of its prior]."""
    prior = equations.problem.simulation.parameters[equations.nuisance.names[place]]
    return prior.reach(equations.thresholds.furthest_linearisation_stds)


def _is_all_that_is_wrong(equations: NormalEquations, freed: NormalEquations, fit: Fit, places: Sequence[int]) -> bool:
    """Return whether no released parameter goes too far, and nothing significant is left beside them."""
    away = equations.nuisance.prior_stds_away(fit)
    too_far = any(away[place] > _reach(equations, place) for place in places)
    return not too_far and unexplained_beside(freed, fit, tolerated=0.0) is None


def _evidence(equations: NormalEquations, fit: Fit, free: Collection[int], entry_threshold: float) -> float:
    """Return minus the χ² of readings and priors, less what terms and parameters outside their priors are charged."""
    away = np.delete(equations.nuisance.prior_stds_away(fit), list(free))
    entries = entry_cost(equations, fit.terms, entry_threshold)
    charged = entries + sum(map(equations.penalty, fit.terms)) + WRONG_STATEMENT_PENALTY * len(free)
    return -float(chi2_of(equations, fit).sum() + away @ away + charged)
