"""Curves that are no finding: readings refute them which they were not fitted to.

What follows a covariate does so at other times, too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.calibration.linearised import worse_than_stated
from regolithd.calibration.mismatch.empirical.found import curves_of
from regolithd.calibration.mismatch.inference.other_answers.probability import decided_by_evidence
from regolithd.calibration.mismatch.inference.unexplained.intermittent import unexplained_if_intermittent
from regolithd.calibration.mismatch.selection.decision import names_of

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.empirical.found import FoundCurve
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.selection.decision import Decision

LEAST_GAIN = 0.001
"""Share by which a curve has to lower the held-out error, as little as is told: of 86 curves of what was concealed in
blind trials the least was 0.0018, and of 65 others 19 had less than this (strangers 27 to 30, seed
2215391127034625401)."""
LEAST_GAIN_WITHOUT_EVIDENCE = 0.01
"""The same of a curve that stands for a name which was refused, and that does not score as a curve has to for its own
sake: of five over nothing the largest was 0.0073, and of curves of what was concealed none is of this kind."""


def without_refuted_curves(decision: Decision, stated: Problem) -> Decision:
    """Return the decision without curves that do not lower the error of held-out readings.

    A curve over time needs to lower none: of what happened once no other time tells. But where the simulation alone is
    then further from the recording than with its `stated` values, curve and parameters cancel each other. Sines over
    time, and what was before, need to lower none either.
    """
    if not decision.unnamed or decision.intermittent:
        return decision
    refuted = [term for curve in curves_of(decision) if _is_refuted(decision, curve, stated) for term in curve.terms]
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
