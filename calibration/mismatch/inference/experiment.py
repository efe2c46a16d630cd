"""The experiment that tells effects apart which one recording cannot: what to drive, and for how long."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

ROUNDED_TO_MINUTES = 5


def experiment_for(
    equations: NormalEquations, given: Sequence[Term], members: Sequence[Term], entry_threshold: float
) -> str:
    """Return the drives that vary each member's covariate alone, and how many minutes they take.

    Where the simulation's free parameters can imitate a member, a drive without load is added: soil has no part in it.
    """
    candidates = [member.group.candidate for member in members if member.group.candidate is not None]
    drives = list(dict.fromkeys(candidate.experiment for candidate in candidates))
    if any(_imitated(equations, given, member) for member in members):
        drives.append(equations.problem.simulation.unloaded_experiment)
    sentence = "; then ".join(filter(None, drives))
    least = max((candidate.experiment_minutes[0] for candidate in candidates), default=0)
    most = max((candidate.experiment_minutes[1] for candidate in candidates), default=0)
    minutes = int(np.clip(minutes_needed(equations, entry_threshold), least, most))
    return f"{sentence[:1].upper()}{sentence[1:]}; {minutes} minutes in all."


def _imitated(equations: NormalEquations, given: Sequence[Term], member: Term) -> bool:
    """Return whether free parameters can imitate most of a member that is there without load too."""
    candidate, least = member.group.candidate, equations.thresholds.experiment_tolerance
    return candidate is not None and candidate.acts_unloaded and equations.tolerance(given, member) < least


def minutes_needed(equations: NormalEquations, entry_threshold: float) -> float:
    """Return how many minutes must be driven before the smallest effect shows nine times in ten.

    A drive that varies the right covariates leaves a tenth of an effect outside the span of the free parameters; each
    reading then adds to its Δχ² what the noise of this recording allows.
    """
    problem, limits = equations.problem, equations.thresholds
    needed = (sqrt(entry_threshold + limits.coefficient_penalty) + limits.detection_quantile) ** 2
    readings = 60 / problem.recording.step_s
    weights = float(equations.weights.sum())
    size = limits.effect_of_experiment * problem.mean_size
    gained = limits.experiment_tolerance * readings * weights * size**2
    return float(ROUNDED_TO_MINUTES * np.ceil(needed / gained / ROUNDED_TO_MINUTES))
