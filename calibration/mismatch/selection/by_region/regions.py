"""In a range or everywhere: whether what stays unexplained is confined to regions of a covariate.

A law that fails beyond an angle, or below a temperature, leaves a smooth term over that covariate. Regions describe it
better where they score more, by `lead_margin`, than the smooth term and than the simplest laws that hold everywhere.
All pay for their coefficients, and regions for their bounds, by Schwarz's criterion (1978). The parameters are then
fitted together with the regions, so that what the simulation leaves out there does not bias them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.selection.by_region.region_bounds import with_median_bounds
from regolithd.calibration.mismatch.selection.by_region.region_search import (
    everywhere_score,
    regions_beside,
    schwarz_surcharge,
)
from regolithd.calibration.mismatch.selection.cross_validation import transfer_margin
from regolithd.calibration.mismatch.selection.slow_noise import score_beside_slow_noise
from regolithd.calibration.mismatch.selection.smooth_terms import unexplained_beside

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision


def in_regions(decision: Decision) -> Decision:
    """Return the decision with regions in the place of the smooth term, where the evidence favours them.

    What recurs, follows what was before, or comes and goes, is in no region.
    """
    if not decision.unnamed or decision.intermittent or decision.confined:
        return decision
    if decision.unnamed[0].group.coupling in WITHOUT_CURVE:
        return decision
    named, curve = decision.named, decision.unnamed[0]
    needed = _curve_score(decision.equations, named, curve)
    equations, fit = regions_beside(decision.equations, named, needed)
    regions = fit.terms[len(named.terms) :]
    lead = equations.score(fit) - _smooth_score(equations, named, curve, regions)
    if not regions or lead < equations.thresholds.lead_margin:
        return decision
    equations, fit = with_median_bounds(equations, fit)
    if not _holds(equations, fit, len(named.terms), decision.entry_threshold):
        return decision
    return replace(decision, equations=equations, unnamed=fit.terms[len(named.terms) :], whole=fit)


def _curve_score(equations: NormalEquations, named: Fit, curve: Term) -> float:
    """Return the score with a smooth term, its coefficients paid for as those of regions: by Schwarz's criterion."""
    fit = equations.fit((*named.terms, curve))
    return equations.score(fit) - schwarz_surcharge(equations, fit, [curve])


def _smooth_score(equations: NormalEquations, named: Fit, curve: Term, regions: Sequence[Term]) -> float:
    """Return the best score without a bound: of the smooth term, and of the simplest laws that hold everywhere."""
    places = {(term.name, term.group.coupling, term.wheels) for term in (*regions, curve)}
    laws = (equations.score(named) + everywhere_score(equations, named, *place) for place in places)
    return max(_curve_score(equations, named, curve), *laws)


def _holds(equations: NormalEquations, fit: Fit, named: int, entry_threshold: float) -> bool:
    """Return whether nothing significant is left outside, and each region is there: on other parts, and beyond noise.

    Noise of any spectrum does not explain it, and it is found on other parts of the recording.
    """
    places = range(named, len(fit.terms))
    transfers = (transfer_margin(equations, fit.terms, index, entry_threshold) >= 0 for index in places)
    beyond = (score_beside_slow_noise(equations, fit.without(index), [fit.terms[index]]) > 0 for index in places)
    return unexplained_beside(equations, fit) is None and all(transfers) and all(beyond)
