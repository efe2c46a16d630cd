"""Parameters that were stated wrongly, against smooth terms: a value beyond its prior explains more than a curve.

The prior of a parameter holds as long as its statement is right. Where a fit pulls parameters beyond
`furthest_prior_stds`, the prior would bias them, and a free curve beside them is paid twice: for what it fits, and for
every deviation that the parameters need not go then. So these priors are widened; if the parameters are all that is
wrong, nothing significant is left beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.selection.smooth_terms import unexplained_beside

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def released(equations: NormalEquations, named: Fit) -> NormalEquations | None:
    """Return equations with the priors of those parameters widened that would have to leave them.

    None where no parameter would, where one would go further than a wrong statement explains
    (`furthest_linearisation_stds`), or where something stays unexplained all the same.
    """
    limits, nuisance = equations.thresholds, equations.nuisance
    leaving = nuisance.leaving_their_priors(equations.fit(named.terms), equations.problem)
    if not leaving.size:
        return None
    wider = nuisance
    for place in leaving:
        wide = nuisance.precision[place] / limits.furthest_linearisation_stds**2
        wider = wider.with_precision(int(place), float(wide))
    freed = equations.with_nuisance(wider)
    fit = freed.fit(named.terms)
    too_far = np.any(nuisance.prior_stds_away(fit)[leaving] > limits.furthest_linearisation_stds)
    return None if too_far or unexplained_beside(freed, fit, tolerated=0.0) is not None else freed
