"""The experiment that tells effects apart which one recording cannot: what to vary, whether without load, how long."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Indistinguishable
from regolithd.calibration.mismatch.inference.statements import capital
from regolithd.calibration.mismatch.problem.words import in_words
from regolithd.calibration.mismatch.regression.as_read import long_run_weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

UNITS_S = {"hours": 3600.0, "minutes": 60.0, "s": 1.0}
LEAST_IN_UNIT = 5.0
"""Durations are told in the largest unit of which they are so many, rounded up to as many again (a choice)."""


def with_experiment(
    names: tuple[str, ...],
    equations: NormalEquations,
    given: Sequence[Term],
    members: Sequence[Term],
    entry_threshold: float,
) -> Indistinguishable:
    """Return a set of effects with the experiment that varies each member's covariate alone.

    Where the simulation's free parameters can imitate a member, a part without load is added: there they have no part.
    """
    problem = equations.problem
    candidates = [member.group.candidate for member in members if member.group.candidate is not None]
    drives = [in_words(candidate.experiment, problem.labels) for candidate in candidates]
    unloaded = problem.simulation.unloaded_experiment
    hidden = any(_imitated(equations, given, member) for member in members)
    lift = bool(unloaded) and (hidden or any(candidate.run_unloaded for candidate in candidates))
    sentence = "; then ".join(dict.fromkeys([*drives, unloaded] if lift else drives))
    duration_s, in_all = rounded_up(seconds_needed(equations, entry_threshold))
    return Indistinguishable(
        effects=names,
        experiment=f"{capital(sentence)}; {in_all} in all.",
        vary=tuple(dict.fromkeys(name for candidate in candidates for name in candidate.varied(problem))),
        duration_s=duration_s,
        lift=lift,
    )


def _imitated(equations: NormalEquations, given: Sequence[Term], member: Term) -> bool:
    """Return whether free parameters can imitate most of a member that is there without load too."""
    candidate, least = member.group.candidate, equations.thresholds.experiment_tolerance
    return candidate is not None and candidate.acts_unloaded and equations.tolerance(given, member) < least


def seconds_needed(equations: NormalEquations, entry_threshold: float) -> float:
    """Return how long an experiment must last before the smallest effect shows nine times in ten [s].

    Varying the right covariates leaves a tenth of an effect outside the span of the free parameters; each reading then
    adds to its Δχ² what the noise of this recording allows.
    """
    problem, limits = equations.problem, equations.thresholds
    needed = (sqrt(entry_threshold + limits.coefficient_penalty) + limits.detection_quantile) ** 2
    size = limits.effect_of_experiment * problem.mean_size
    gained = limits.experiment_tolerance * float(long_run_weights(equations, equations.fit(())).sum()) * size**2
    within = limits.shortest_experiment * problem.length_s, limits.longest_experiment * problem.length_s
    return float(np.clip(problem.recording.step_s * needed / gained, *within))


def rounded_up(seconds: float) -> tuple[float, str]:
    """Return a duration of a few units [s], and in words."""
    unit, unit_s = next(
        ((unit, unit_s) for unit, unit_s in UNITS_S.items() if seconds >= LEAST_IN_UNIT * unit_s), ("s", 1.0)
    )
    rounded = LEAST_IN_UNIT * np.ceil(seconds / unit_s / LEAST_IN_UNIT)
    return float(rounded * unit_s), f"{rounded:.0f} {unit}"
