"""What stays unexplained over a covariate that has the sign of the motion: friction, whose direction it shows better.

A speed that is read with noise has the wrong sign beside each standstill. A force that acts against the motion has the
right one, and is 0 where the machine stands: a curve over it fits friction better than any law along the speed's sign.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.words import word_for
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

LEAST_AGREEMENT = 0.9
"""Share of the readings in motion in which the covariate has the sign of the motion (a choice)."""
LEAST_SHARE = 0.5
"""Share of what the curve explains that its sign alone explains (a choice: the rest may be friction that changes)."""


def notes_on_shown_direction(decision: Decision) -> tuple[str, ...]:
    """Return a note for each curve over a covariate that tells the direction of a friction better than the speed."""
    equations, problem, whole = decision.equations, decision.equations.problem, decision.whole
    if not problem.has("direction") or not decision.unnamed or decision.intermittent:
        return ()
    left, direction, notes = residual_of(equations, whole), problem.known("direction"), []
    for index, term in enumerate(whole.terms):
        if term.group.named or term.name not in problem.covariates or term.name == "direction":
            continue
        shown, curve = np.sign(problem.known(term.name)), contribution(equations, whole, index)
        read = problem.mask & np.isin(np.arange(left.shape[1]), term.wheels)
        moving = read & (direction != 0) & (shown != 0)
        ways = shown[moving] * direction[moving]
        if np.unique(shown[moving]).size < 2 or abs(float(np.mean(ways))) < 2 * LEAST_AGREEMENT - 1:
            continue
        held = (left + curve)[read]
        of_sign, of_speed = (_explained(held, each[read]) for each in (shown, direction))
        if of_sign > max(of_speed, LEAST_SHARE * float(np.sum(curve[read] ** 2))):
            word = word_for(term.name, problem.labels)
            notes.append(
                f"What is unexplained over the {word} follows its sign, which is that of the motion, more closely than "
                f"the sign of the speed: it may be friction. If the {word} shows the direction, return wheel_speed "
                "with its sign, and 0 at standstill, from `covariates`."
            )
    return tuple(notes)


def _explained(held: Array, column: Array) -> float:
    """Return the sum of squares of readings (reading,) that a column explains."""
    return float(column @ held) ** 2 / max(float(column @ column), 1e-300)
