"""The clock of a corrected effect that begins at a time: that of the recording in which it was found.

What has worn does not heal. In the recording in which it was found, an effect acts from its onset on, as it was fitted.
Any other recording is a later one: its first reading lies beyond the end of that recording, and the effect has the size
that it had there. Both are one rule: the effect's clock is that of the recording in which it was found, and stops with
it. So a recording that goes on after that one's last reading has the effect from its onset on, and its last size then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem

TIME_DECIMALS = 6
"""Times are compared to a microsecond: seconds since 1970 are known no better."""


@dataclass(frozen=True)
class FoundIn:
    """The recording in which an effect was found, so that it is known again.

    Attributes
    ----------
    digest: of its times and of the readings of the predicted channel
    instants: how many it has
    end_s: its last instant [s]
    """

    digest: str
    instants: int
    end_s: float


def found_here(problem: Problem) -> FoundIn:
    """Return what this problem's recording is known by."""
    instants = len(problem.time_s)
    return FoundIn(_digest(problem, instants), instants, _elapsed(problem, instants)[-1])


def on_the_clock_of(problem: Problem, found: FoundIn | None) -> Problem:
    """Return the problem with the time as an effect has it; None: its onset is on each recording's own clock."""
    if found is None:
        return problem
    time_s = np.minimum(np.inf if is_later(problem, found) else problem.covariates["time"], found.end_s)
    time_s = np.broadcast_to(time_s, problem.mask.shape)
    return replace(problem, covariates={**problem.covariates, "time": time_s}, made={})


def is_later(problem: Problem, found: FoundIn | None) -> bool:
    """Return whether a recording is later than the one in which an effect was found: it does not begin with that."""
    return found is not None and (
        len(problem.time_s) < found.instants or _digest(problem, found.instants) != found.digest
    )


def _elapsed(problem: Problem, instants: int) -> list[float]:
    time_s = problem.time_s[:instants, 0]
    return (np.round(time_s - time_s[0], TIME_DECIMALS) + 0.0).tolist()


def _digest(problem: Problem, instants: int) -> str:
    """Return a digest of the first instants."""
    readings = problem.measured[:instants]
    content = np.array(_elapsed(problem, instants)).tobytes() + np.where(np.isnan(readings), np.nan, readings).tobytes()
    return sha256(content).hexdigest()[:16]
