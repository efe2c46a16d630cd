"""Curves that are no finding: readings refute them which they were not fitted to, or errors of the inputs explain them.

What follows a covariate does so at other times, too. And what the errors of inputs leave in a state wanders: a curve,
over time before all, follows that as it would follow physics.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.linearised import worse_than_stated
from regolithd.calibration.mismatch.empirical.found import curves_of
from regolithd.calibration.mismatch.inference.intermittent import unexplained_if_intermittent
from regolithd.calibration.mismatch.inference.probability import decided_by_evidence
from regolithd.calibration.mismatch.regression.lasting_errors import has_lasting_errors
from regolithd.calibration.mismatch.regression.schur import pseudo_inverse
from regolithd.calibration.mismatch.selection.decision import names_of

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.empirical.found import FoundCurve
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

LEAST_GAIN = 0.001
"""Share by which a curve has to lower the held-out error, as little as is told: of 86 curves of what was concealed in
blind trials the least was 0.0018, and of 65 others 19 had less than this (strangers 27 to 30, seed
2215391127034625401)."""
LEAST_GAIN_WITHOUT_EVIDENCE = 0.01
"""The same of a curve that stands for a name which was refused, and that does not score as a curve has to for its own
sake: of five over nothing the largest was 0.0073, and of curves of what was concealed none is of this kind."""
IMPROBABLE = 3.0
"""Standard deviations beyond the mean of what errors give, from which more is there (a choice: 1 in 740 of a normal
density)."""
SINGULAR = 1e-9
"""Relative eigenvalue below which a direction counts as undetermined."""


def without_refuted_curves(decision: Decision, stated: Problem) -> Decision:
    """Return the decision without curves that do not lower the error of held-out readings, or that errors explain.

    A curve over time needs to lower none: of what happened once no other time tells. But where the simulation alone is
    then further from the recording than with its `stated` values, curve and parameters cancel each other. Sines over
    time, and what was before, need to lower none either.
    """
    if not decision.unnamed or decision.intermittent:
        return decision
    refuted = [term for curve in curves_of(decision) if _is_refuted(decision, curve, stated) for term in curve.terms]
    refuted += [term for term in decision.unnamed if _is_explained_by_errors(decision, term)]
    if not refuted:
        return decision
    unnamed = tuple(term for term in decision.unnamed if not any(term is each for each in refuted))
    whole = decision.equations.fit((*decision.named.terms, *unnamed))
    kept = replace(decision, unnamed=unnamed, whole=whole, refused=decision.refused | {names_of(decision)})
    return kept if unnamed else unexplained_if_intermittent(kept)


def _is_refuted(decision: Decision, found: FoundCurve, stated: Problem) -> bool:
    curve = found.curve
    least = LEAST_GAIN if decided_by_evidence(decision) else LEAST_GAIN_WITHOUT_EVIDENCE
    if curve.held_out_rmse_after <= (1 - least) * curve.held_out_rmse_before:
        return False
    over_time = any(term.name == "time" for term in found.terms)
    return not over_time or bool(worse_than_stated(decision.equations, decision.whole, stated))


def _is_explained_by_errors(decision: Decision, term: Term) -> bool:
    """Return whether a curve gains no more than it would of what the inputs' errors leave in a state.

    That is the mean of its gains on draws of them, and as many of their standard deviations as make chance improbable.
    """
    equations, whole = decision.equations, decision.whole
    if not has_lasting_errors(equations.problem):
        return False
    index = next(place for place, each in enumerate(whole.terms) if each is term)
    of_term = whole.of_term(index)
    rest = np.delete(np.arange(len(whole.columns)), of_term)
    information, moments = pseudo_inverse(whole.covariance, SINGULAR), equations.moments_of_errors(whole.columns)
    gains = _explained(information, moments) - _explained(information[np.ix_(rest, rest)], moments[:, rest])
    gained = whole.delta_chi2 - equations.fit(whole.without(index)).delta_chi2
    return gained < float(np.mean(gains) + IMPROBABLE * np.std(gains))


def _explained(information: Array, moments: Array) -> Array:
    """Return the Δχ² of columns on each of some residuals, shape (residual,), by their moments (residual, column)."""
    return np.asarray(np.einsum("da,ab,db->d", moments, pseudo_inverse(information, SINGULAR), moments))
