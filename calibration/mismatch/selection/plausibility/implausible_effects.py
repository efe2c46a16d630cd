"""Names that stand in for what cannot be named: an effect that is not plausible explains the recording far better.

A delay of less than a reading may be the solver's own and gets no name. Another law that follows a part of it must not
get one in its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.selection.best_subsets import (
    best_of_each_candidate,
    optimised_shapes,
    physically_plausible,
)

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def drop_what_the_implausible_explains(equations: NormalEquations, named: Fit, entry_threshold: float) -> Fit:
    """Return the fit without effects that gain nothing beside an implausible one, which explains more in their place.

    More is what a smooth term must score. Of each effect's rivals the one that explains most is asked.
    """
    kept, least = named, equations.thresholds.smooth_term_entry
    for term in named.terms:
        others = [other for other in kept.terms if other is not term]
        gained = equations.score(kept) - equations.score(equations.fit(others))
        scored = [pair for pair in best_of_each_candidate(equations, others) if pair[1].name != term.name]
        if not scored or scored[0][0] < gained + least:
            continue
        optimised, terms = optimised_shapes(equations, (*others, scored[0][1]))
        instead, both = optimised.fit(terms), optimised.fit((*terms, term))
        gains_beside = optimised.score(both) - optimised.score(instead) >= entry_threshold
        if not gains_beside and not physically_plausible(optimised, instead, len(others)):
            kept = equations.fit(others)
    return kept
