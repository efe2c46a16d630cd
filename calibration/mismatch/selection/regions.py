"""In a range or everywhere: whether what stays unexplained is confined to regions of a covariate.

A law that fails beyond an angle, or below a temperature, leaves a smooth term over that covariate. Regions describe it
better where they score more than the smooth term and than the simplest laws that hold everywhere, each paying for its
coefficients and for the choice of its bounds. The parameters are then fitted together with the regions, and what the
simulation leaves out in them does not bias the parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.regression.smooth_groups import PERIODIC
from regolithd.calibration.mismatch.selection.cross_validation import transfer_margin
from regolithd.calibration.mismatch.selection.region_bounds import with_median_bounds
from regolithd.calibration.mismatch.selection.region_search import everywhere_score, regions_beside
from regolithd.calibration.mismatch.selection.smooth_terms import unexplained_beside

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision


def in_regions(decision: Decision) -> Decision:
    """Return the decision with regions in the place of the smooth term, where the evidence favours them."""
    if not decision.unnamed or decision.unnamed[0].group.coupling == PERIODIC:
        return decision
    named, curve = decision.named, decision.unnamed[0]
    smooth = decision.equations.score(decision.equations.fit((*named.terms, curve)))
    equations, fit = regions_beside(decision.equations, named, smooth)
    if len(fit.terms) == len(named.terms) or not _favoured(equations, named, fit, curve):
        return decision
    equations, fit = with_median_bounds(equations, fit)
    if not _holds(equations, fit, len(named.terms), decision.entry_threshold):
        return decision
    return replace(decision, equations=equations, unnamed=fit.terms[len(named.terms) :], whole=fit)


def _favoured(equations: NormalEquations, named: Fit, fit: Fit, curve: Term) -> bool:
    """Return whether regions lead the smooth term and the simplest laws everywhere by more than chance gives."""
    smooth = [equations.score(equations.fit((*named.terms, curve)))]
    places = {(term.name, term.group.coupling, term.wheels) for term in (*fit.terms[len(named.terms) :], curve)}
    smooth += [equations.score(named) + everywhere_score(equations, named, *place) for place in places]
    return equations.score(fit) > max(smooth) + equations.thresholds.lead_margin


def _holds(equations: NormalEquations, fit: Fit, named: int, entry_threshold: float) -> bool:
    """Return whether nothing significant is left outside, and every region is found on other parts of the recording."""
    transfers = (
        transfer_margin(equations, fit.terms, index, entry_threshold) >= 0 for index in range(named, len(fit.terms))
    )
    return unexplained_beside(equations, fit) is None and all(transfers)
