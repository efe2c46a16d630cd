"""How sure an answer is of its set of names: its share of the evidence of all answers of one step's difference.

The posterior probability of an answer among others is proportional to exp(evidence / 2) where noise and laws are exact.
Neither is, so the difference counts less (`evidence_scale`), and something that no alternative covers may be wrong
whatever the margin (`highest_probability`). Both were fitted to blind trials (docs/proof.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import RunnerUp
from regolithd.calibration.mismatch.inference.alternatives import UNEXPLAINED, alternatives

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.inference.alternatives import Alternative
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.thresholds import Thresholds

LARGEST_MARGIN = 500.0
"""Margin in either direction beyond which nothing changes: the exponential stays finite."""


def probability_of(decision: Decision) -> tuple[float, RunnerUp | None]:
    """Return the probability that the set of names is right, and the answer that is next."""
    others = alternatives(decision)
    limits = decision.equations.thresholds
    return probability(others, limits), runner_up(others, limits)


def probability(others: Sequence[Alternative], thresholds: Thresholds) -> float:
    """Return the share of the given answer, whose margin to itself is 0."""
    return thresholds.highest_probability / (1 + float(np.sum(_relative(others, thresholds))))


def runner_up(others: Sequence[Alternative], thresholds: Thresholds) -> RunnerUp | None:
    """Return the best other answer, if there is one."""
    if not others:
        return None
    best, relative = others[0], _relative(others, thresholds)
    names = tuple(name for name in best.effects if name != UNEXPLAINED)
    return RunnerUp(
        effects=names,
        unexplained=UNEXPLAINED in best.effects,
        probability=float(thresholds.highest_probability * relative[0] / (1 + relative.sum())),
    )


def _relative(others: Sequence[Alternative], thresholds: Thresholds) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return how likely each alternative is against the given answer."""
    margins = np.array([each.margin for each in others], np.float64)
    return np.asarray(np.exp(-np.clip(margins, -LARGEST_MARGIN, LARGEST_MARGIN) / thresholds.evidence_scale))
