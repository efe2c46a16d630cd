"""Effects that pull a parameter of the simulation out of its prior: two terms that cancel each other, and no physics.

Where an input is noisy, a parameter that acts through it (an inertia, through a differentiated speed) and an effect of
the same kind, through a cleaner course of it, move against each other: their difference removes noise. An effect that
is there lets the parameters return to their priors instead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.selection.plausibility.law_misfit import settled

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def drop_what_pulls_parameters_out(equations: NormalEquations, named: Fit) -> Fit:
    """Return the fit without the effects beside which parameters leave their priors that are within them otherwise.

    The effect without which fewest are outside is left out first; of equals, that which gains least. The delay of an
    input that is on time stays: the parameters would make up for it.
    """
    kept = settled(equations, named)
    without_any = _outside(equations, kept)
    while len(named.terms) > len(kept.terms) and _outside(equations, named) - without_any:
        others = [index for index, term in enumerate(named.terms) if term not in kept.terms]
        fits = [equations.fit(named.without(index)) for index in others]
        named = min(fits, key=lambda fit: (len(_outside(equations, fit) - without_any), -equations.score(fit)))
    return named


def _outside(equations: NormalEquations, fit: Fit) -> set[int]:
    """Return the places of the parameters that are outside their priors in a fit."""
    return set(equations.nuisance.leaving_their_priors(fit, equations.problem).tolist())
