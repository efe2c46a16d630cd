"""What to drive, and for how long, to tell effects apart that one recording cannot."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.inference.sensitivity import NINE_IN_TEN
from regolithd.calibration.mismatch.selection.subset_selection import PER_COEFFICIENT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.selection.subset_selection import Search, Term

SMALLEST = 0.05
"""Of the mean magnitude of the predicted channel: the least effect that an experiment is to show."""
REMAINS = 0.1
"""Of a friction's energy, outside what gain, cohesion and friction angle can imitate once speed and direction vary."""


def experiment_for(search: Search, given: Sequence[Term], members: Sequence[Term]) -> str:
    """Return the drives that vary each member's covariate alone, and how many minutes they take.

    Where the simulation's free parameters can imitate a member, a drive without load is added: soil has no part in it.
    """
    candidates = [member.group.candidate for member in members if member.group.candidate is not None]
    drives = list(dict.fromkeys(candidate.experiment for candidate in candidates))
    if any(_imitated(search, given, member) for member in members):
        drives.append(search.dictionary.problem.simulation.unloaded_experiment)
    sentence = "; then ".join(filter(None, drives))
    least = max((candidate.experiment_minutes[0] for candidate in candidates), default=0)
    most = max((candidate.experiment_minutes[1] for candidate in candidates), default=0)
    return f"{sentence[:1].upper()}{sentence[1:]}; {_minutes_needed(search, least, most)} minutes in all."


def _imitated(search: Search, given: Sequence[Term], member: Term) -> bool:
    """Return whether free parameters can imitate most of a member that is there without load too."""
    candidate = member.group.candidate
    return candidate is not None and candidate.acts_unloaded and search.share_outside(given, member) < REMAINS


def _minutes_needed(search: Search, least: int, most: int) -> int:
    """Return how long a drive must last before an effect of the smallest size shows nine times in ten.

    A drive that moves the right covariates leaves about a tenth of an effect outside the free parameters' reach; each
    reading then adds to its gain what the noise of this recording lets it.
    """
    problem = search.dictionary.problem
    needed = (sqrt(search.threshold + PER_COEFFICIENT) + NINE_IN_TEN) ** 2
    readings = 60 / problem.recording.step_s
    gained = REMAINS * readings * float(search.weights.sum()) * (SMALLEST * problem.mean_size) ** 2
    return int(np.clip(5 * np.ceil(needed / gained / 5), least, most))
