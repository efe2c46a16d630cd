"""How sure an answer is of its set of names: its share of the evidence of all answers of one step's difference.

The posterior probability of an answer among others is proportional to exp(evidence / 2) where noise and laws are exact.
Neither is, so the difference counts less (`evidence_scale`), and something that no alternative covers may be wrong
whatever the margin (`highest_probability`). Both were fitted to blind trials (docs/results/blind-trials.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import OtherAnswer
from regolithd.calibration.mismatch.inference.other_answers.alternatives import LARGEST_MARGIN, with_refused
from regolithd.calibration.mismatch.selection.decision import UNEXPLAINED, answer_names

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.thresholds import Thresholds

TOLD = 3
"""Other answers that are told."""


def decided_by_evidence(decision: Decision) -> bool:
    """Return whether each curve of what is unexplained scores as much as an effect must, to enter.

    Else it stands for another finding, and the evidence says nothing of how probable the answer is: one that stands for
    what comes and goes has to score as a curve that is told for its own sake.
    """
    equations, whole = decision.equations, decision.whole
    told = equations.score(whole)

    def gain(curve: Term) -> float:
        return told - equations.score(equations.fit([term for term in whole.terms if term is not curve]))

    on_its_own, spells = equations.thresholds.smooth_term_entry, [each.term for each in decision.intermittent]
    return all(
        gain(curve) > (on_its_own if curve in spells else decision.entry_threshold) for curve in decision.unnamed
    )


def is_known(decision: Decision, others: Sequence[Alternative]) -> bool:
    """Return whether the evidence, which decided an answer, says how probable it is beside others, best first.

    What comes and goes is told by its two levels. A curve over time has less evidence than these: where another answer
    has more than the curve, the evidence says nothing.
    """
    return not (decision.intermittent and others and others[0].margin < 0)


def probability(others: Sequence[Alternative], thresholds: Thresholds) -> float:
    """Return the share of the given answer, whose margin to itself is 0."""
    return thresholds.highest_probability / (1 + float(np.sum(relative([each.margin for each in others], thresholds))))


def other_answers(others: Sequence[Alternative], thresholds: Thresholds) -> tuple[OtherAnswer, ...]:
    """Return the most probable other answers, best first."""
    probabilities = probability_of_others(others, thresholds)
    return tuple(
        OtherAnswer(
            effects=tuple(name for name in other.effects if name != UNEXPLAINED),
            unexplained=UNEXPLAINED in other.effects,
            probability=float(probable),
            parameters=other.parameters,
        )
        for other, probable in zip(others[:TOLD], probabilities, strict=False)
    )


def probability_of_others(
    others: Sequence[Alternative], thresholds: Thresholds
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the share of each other answer."""
    of_each = relative([each.margin for each in others], thresholds)
    return np.asarray(thresholds.highest_probability * of_each / (1 + of_each.sum()))


def leads_of(decision: Decision) -> list[float]:
    """Return by how much an answer is ahead of itself without each of its terms, by the evidence, in Δχ².

    Infinite where the answer without it is none that comes near, and where the evidence did not decide.
    """
    terms = decision.whole.terms
    told = set(answer_names(terms))
    others = with_refused(decision) if told and decided_by_evidence(decision) else ()
    less = [(set(other.effects), other.margin) for other in others] if is_known(decision, others) else []
    return [
        min((margin for names, margin in less if names <= told - set(answer_names([term]))), default=np.inf)
        for term in terms
    ]


def relative(margins: Sequence[float], thresholds: Thresholds) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return how likely answers are against the given one, by which its evidence is ahead of theirs (Δχ²)."""
    ahead = np.clip(np.array(margins, np.float64), -LARGEST_MARGIN, LARGEST_MARGIN)
    return np.asarray(np.exp(-ahead / thresholds.evidence_scale))
