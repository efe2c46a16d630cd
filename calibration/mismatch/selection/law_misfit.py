"""What effects explain as a whole, and how much of it their laws miss.

No law is exact to the last percent. A corrected effect that has changed is inexact by a share of its whole size, of
which the prediction has a part already.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.regression.nuisance import EXACT

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def law_misfit(equations: NormalEquations, names: Fit, with_curve: Fit) -> float:
    """Return the share of Δχ² that a curve adds to names, or has in their place."""
    gain = with_curve.delta_chi2 - names.delta_chi2
    return gain / max(explained(equations, names) + gain, 1e-9)


def explained(equations: NormalEquations, fit: Fit) -> float:
    """Return the Δχ² of a fit, with what is in the prediction already of corrected effects that it changes."""
    sizes = [term.group.candidate.stated_size if term.group.candidate else 0.0 for term in fit.terms]
    if not any(sizes):
        return fit.delta_chi2
    held = equations.nuisance
    for place, name in enumerate(held.names):
        held = held.with_precision(place, EXACT) if name in held.stated else held
    as_stated, total = equations.with_nuisance(held), fit.delta_chi2
    for index, (term, size) in enumerate(zip(fit.terms, sizes, strict=True)):
        if not size:
            continue
        change = fit.coefficients[fit.of_term(index)]
        now = change + size * equations.design.scale[list(term.group.columns)]
        _, energy = as_stated.own_and_complement(fit.without(index), term)
        total += max(float(now @ energy @ now - change @ energy @ change), 0.0)
    return total
