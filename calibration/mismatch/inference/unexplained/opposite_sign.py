"""What stays unexplained, held against friction of the opposite sign.

Friction adds to what a drive takes, and takes from what a generator gives. In which of the two the predicted channel
is, no column says: of a machine whose `wheel_speed` is stated with the sign of the other, friction has the wrong sign.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.regression.group import Group
    from regolithd.calibration.mismatch.selection.decision import Decision

LEAST_SHARE = 0.9
"""Share of what the curves gain, in Δχ², that one law has to gain (a choice: a curve fits some of the noise, too)."""


def notes_on_opposite_sign(decision: Decision) -> tuple[str, ...]:
    """Return a note where a law along the motion explains as much with the opposite sign as the curves do."""
    equations, named = decision.equations, decision.named
    if not decision.unnamed or decision.intermittent:
        return ()
    gained = LEAST_SHARE * (decision.whole.delta_chi2 - named.delta_chi2)
    best = equations.gains(named.terms, list(_opposite(equations.design.groups))).largest_score()
    if best is None or equations.fit((*named.terms, best[1])).delta_chi2 - named.delta_chi2 < gained:
        return ()
    channel = equations.problem.simulation.channel
    note = (
        f"What is unexplained in {channel} would be {best[1].name} if that took from {channel} in the direction of "
        "wheel_speed, instead of adding to it. If the channel is what the machine gives, as a generator's power is, "
        "return wheel_speed with the opposite sign from `covariates`. If not, the simulation has more of it than the "
        "machine."
    )
    return (note,)


def _opposite(groups: tuple[Group, ...]) -> Iterator[Group]:
    """Yield the laws along the motion whose coefficients have one sign, with the other."""
    for group in groups:
        if group.candidate is not None and group.candidate.along_motion and not group.is_change and any(group.signs):
            yield replace(group, signs=tuple(-sign for sign in group.signs))
