"""What to look at where the residual follows what was predicted, or how the machine was accelerated, before."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.problem.words import word_for
from regolithd.calibration.mismatch.regression.lagged_groups import LAGGED

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.selection.decision import Decision


def notes_on_dynamics(decision: Decision) -> tuple[str, ...]:
    """Return a note where something is unexplained over the past: what it may be, and what would tell.

    Parameters with wide priors can stand for a part of a delay, which then has not the form of a delay any more.
    """
    lagged = [term.name for term in decision.unnamed if term.name in LAGGED]
    if not lagged:
        return ()
    problem = decision.equations.problem
    past, channel = word_for(lagged[0], problem.labels), problem.simulation.channel
    note = (
        f"What is unexplained over the {past} is how {channel} follows in time: a late reading, a filter, an "
        f"oscillation, or a time constant that is stated wrongly. Parameters with wide priors can hide that it is a "
        f"delay: state those better that change how fast the prediction follows."
    )
    return (note,)
