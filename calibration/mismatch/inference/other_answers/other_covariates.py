"""Other covariates that what stays unexplained follows as well: on which of them it depends the recording cannot tell.

The rotor speed of a fan and its predicted torque go together, as the level of a tank goes with the voltage of its pump.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.problem.words import with_article, word_for
from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.regression.groups.smooth_groups import is_constant, same_covariate
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.decision import UNEXPLAINED
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import is_of_the_prediction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision


def notes_on_other_covariates(decision: Decision) -> tuple[str, ...]:
    """Return a note where curves over other covariates, on the same wheels, explain nearly as much.

    As much but for the share that an inexact law may leave (`form_misfit`): knots lie otherwise over another covariate.
    A curve over time has knots enough to follow what changes seldom, and is another cause only where it explains more.
    Where several things stay unexplained, each has been told beside the others. What comes and goes has no covariate;
    no curve follows a sine. Beside what acts on a state, curves that act so count as well.
    """
    if len({term.name for term in decision.unnamed}) != 1 or decision.intermittent:
        return ()
    told, problem = decision.unnamed[0], decision.equations.problem
    if told.group.coupling in WITHOUT_CURVE - {ON_STATE} or is_constant(told):
        return ()
    scores = _scores_over(decision, told)
    most = scores.get(told.name, float("inf"))
    least = (1 - decision.equations.thresholds.form_misfit) * most
    others = [
        name
        for name, score in scores.items()
        if score >= (most if name == "time" else least) and not same_covariate(problem, name, told.name, told.wheels)
    ]
    if not others:
        return ()
    here = with_article(told.name, problem.labels)
    there = " and ".join(with_article(name, problem.labels) for name in others)
    note = f"What is unexplained over {here} follows {there} nearly as well"
    why = "they go together in this recording, or it hardly depends on any of them"
    return (f"{note}: {why}. One has to vary without the other to tell which it depends on.",)


WAYS = {
    "gain": "a share of the prediction",
    "drag": "a drag along the motion, whatever the prediction",
    "offset": "an offset, whatever the prediction and the motion",
}
"""What a curve may be by its coupling."""


def notes_on_ways_to_act(decision: Decision) -> tuple[str, ...]:
    """Return a note where the one curve acts in another way as probably, over the same covariate and wheels.

    In a recording at one load a share of the prediction and a drag are the same; in another they are not. Over the
    prediction itself they are one.
    """
    if len(decision.unnamed) != 1 or decision.intermittent or decision.unnamed[0].group.coupling not in WAYS:
        return ()
    told, limits = decision.unnamed[0], decision.equations.thresholds
    if is_of_the_prediction(decision.equations.problem, told):
        return ()
    scores = {
        term.group.coupling: score
        for score, term in best_of_each_smooth_term(decision.equations, decision.named.terms)
        if (term.name, term.wheels) == (told.name, told.wheels) and term.group.coupling in WAYS
    }
    least = scores.get(told.group.coupling, float("inf")) - limits.lead_margin
    others = [
        WAYS[coupling] for coupling, score in scores.items() if coupling != told.group.coupling and score >= least
    ]
    if not others:
        return ()
    here = word_for(told.name, decision.equations.problem.labels)
    note = (
        f"Whether what is unexplained over the {here} is {WAYS[told.group.coupling]} or {' or '.join(others)}, this "
        "recording does not tell: a corrected simulation has it as the first. The prediction has to vary at the same "
        f"{here} to tell."
    )
    return (note,)


def notes_on_a_curve_in_place(decision: Decision, others: Sequence[Alternative]) -> tuple[str, ...]:
    """Return a note where a curve over another covariate is as probable as the only name, or nearly.

    `others` are the other answers, with their terms.
    """
    labels, chance = decision.equations.problem.labels, decision.equations.thresholds.lead_margin
    curves = [
        other.terms[0]
        for other in others
        if other.effects == (UNEXPLAINED,) and len(other.terms) == 1 and other.margin <= chance
    ]
    if len(decision.named.terms) != 1 or not curves or curves[0].group.coupling in WITHOUT_CURVE:
        return ()
    (named,), (curve, *_) = decision.named.terms, curves
    here, there = word_for(named.imitated_over, labels), word_for(curve.name, labels)
    shape = "a constant share of the prediction, without a name"
    what = shape if is_constant(curve) else f"something without a name that follows the {there}"
    note = f"{named.name} is about as probable as {what}"
    if is_constant(curve) or named.imitated_over == "none":
        return (f"{note}: the {there} has to vary further to tell.",)
    why = f"{here} and {there} go together in this recording"
    return (f"{note}: {why}. One has to vary without the other to tell which it depends on.",)


def _scores_over(decision: Decision, told: Term) -> dict[str, float]:
    """Return the best score of a curve over each covariate, on the wheels of the one that is told, best first."""
    without = WITHOUT_CURVE - {told.group.coupling}
    scores: dict[str, float] = {}
    for score, term in best_of_each_smooth_term(decision.equations, decision.named.terms):
        if term.wheels == told.wheels and term.group.coupling not in without:
            scores.setdefault(term.name, score)
    return scores
