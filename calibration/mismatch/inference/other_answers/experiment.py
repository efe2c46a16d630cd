"""The experiment that tells effects apart which one recording cannot: what to vary, whether without load, how long."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Indistinguishable
from regolithd.calibration.mismatch.experiments.drives import DIRECTION, SPEED
from regolithd.calibration.mismatch.experiments.margins import of_both, of_effect, of_parameter, predictable
from regolithd.calibration.mismatch.inference.statements import capital, listed
from regolithd.calibration.mismatch.problem.words import column_of, in_words, label_of_column, unit_in_label, word_for
from regolithd.calibration.mismatch.regression.likelihood.as_read import long_run_weights

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.experiments.choice import Choice, Experimenter
    from regolithd.calibration.mismatch.experiments.margins import Hypothesis
    from regolithd.calibration.mismatch.experiments.settings import Setting
    from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

UNITS_S = {"hours": 3600.0, "minutes": 60.0, "s": 1.0}
LEAST_IN_UNIT = 5.0
"""Durations are told in the largest unit of which they are so many, rounded up to as many again (a choice)."""
LIKELY_MARGIN = 6.0
"""Margin of evidence up to which another answer is held against a set of effects: odds of one in twenty (a choice)."""
NEXT_TO_NOTHING = 1e-3
"""Share of the other end of a range below which an end is told as 0 (a choice: two digits are told)."""
AS_GOOD_AS_REACHED = 0.05
"""Share by which a margin may be short of what is needed (a choice: both are told in whole numbers)."""
MOST_OTHERS = 4
"""Other answers that are held against a set (a choice: computing time)."""


@dataclass(frozen=True, eq=False)
class Addition:
    """An effect that may act beside a named one, which then has another shape and size.

    Attributes
    ----------
    law: the named effect, as it is beside the other
    more: the other
    """

    law: Term
    more: Term


def with_experiment(
    names: tuple[str, ...],
    experimenter: Experimenter,
    given: Sequence[Term],
    members: Sequence[Term],
    others: Sequence[Alternative] = (),
    beside: Sequence[Addition] = (),
) -> Indistinguishable:
    """Return a set of effects with the experiment that tells its members, and other likely answers, apart.

    `names` are those that may be true alone, `members` the effects among them; those of `beside` come after them.

    It is the predicted drive with the largest expected margin between the two closest of them. What follows from no
    drive (a fault that grows with time), and all where drives cannot be predicted, is told by its own experiment.
    """
    equations = experimenter.equations
    choice = experimenter.choose(
        _hypotheses(names, experimenter.equations, given, members, others, beside),
        [term for term in given if predictable(term)],
    )
    if choice is None:
        return _own_experiments(names, experimenter, given, members, beside)
    members, names = _with_additions(members, names, beside)
    problem, unloaded = equations.problem, equations.problem.simulation.unloaded_experiment
    left = [member.group.candidate for member in members if not predictable(member)]
    apart = [candidate for candidate in left if candidate is not None]
    drives = [
        *_instructions(problem, choice.varied, [*members, *_terms(others)]),
        *(_instruction(candidate, problem) for candidate in apart),
    ]
    lift = bool(unloaded) and (choice.lift or any(candidate.run_unloaded for candidate in apart))
    duration_s, in_all = rounded_up(choice.duration_s)
    sentence = "; then ".join(dict.fromkeys([*drives, unloaded] if lift else drives))
    ranges = listed([range_in_words(problem, setting) for setting in choice.settings]) if choice.settings else ""
    return Indistinguishable(
        effects=names,
        beside=tuple(addition.more.name for addition in beside),
        experiment=f"{capital(sentence)}; {in_all} in all{ranges and f' ({ranges})'}. {_expectation(choice, names)}",
        vary=tuple(dict.fromkeys((*choice.varied, *(name for each in apart for name in varied_by(each, problem))))),
        duration_s=duration_s,
        lift=lift,
        channel=problem.simulation.channel,
    )


def _hypotheses(
    names: Iterable[str],
    equations: NormalEquations,
    given: Sequence[Term],
    members: Sequence[Term],
    others: Sequence[Alternative],
    beside: Sequence[Addition],
) -> list[Hypothesis]:
    """Return what may be true: the members, the parameters among the names, additions, and other likely answers."""
    found = {member.name: of_effect(equations, given, member) for member in members if predictable(member)}
    for addition in beside:
        if predictable(addition.law) and predictable(addition.more):
            found[addition.more.name] = of_both(equations, given, addition.law, addition.more)
    effects = {member.name for member in members}
    parameters = [of_parameter(equations, given, name) for name in names if name not in effects]
    kept = {term.name for term in given}
    likely = [other for other in others if other.margin < LIKELY_MARGIN + min(each.margin for each in (*others,))]
    for other in likely[:MOST_OTHERS]:
        instead = [term for term in other.terms if term.name not in kept and term.group.named]
        if len(instead) == 1 and instead[0].name not in found and predictable(instead[0]):
            found[instead[0].name] = of_effect(equations, other.terms, instead[0])
    return [*found.values(), *(each for each in parameters if each is not None)]


def _instructions(problem: Problem, varied: Iterable[str], first: Sequence[Term]) -> list[str]:
    """Return instructions that vary these covariates: those of the terms' candidates, as few as do it, then others."""
    wanted = set(varied)
    found: list[str] = []
    candidates = dict.fromkeys(term.group.candidate for term in first if term.group.candidate is not None)
    left = set(wanted)
    while left:
        best = max(candidates, key=lambda each: _covered(each, problem, wanted, left), default=None)
        if best is None or not _covered(best, problem, wanted, left):
            words = [word_for(name, problem.labels) for name in sorted(left)]
            return [*found, f"hold at least four values of the {listed(words)}"]
        left -= set(varied_by(best, problem))
        found.append(_instruction(best, problem))
    return found


def _covered(candidate: Candidate, problem: Problem, wanted: set[str], left: set[str]) -> int:
    """Return how many covariates that are left an experiment varies; 0 where it varies others than are wanted."""
    varied = set(varied_by(candidate, problem))
    return len(varied & left) if varied <= wanted else 0


def _instruction(candidate: Candidate, problem: Problem) -> str:
    """Return a candidate's experiment in the machine's words."""
    return in_words(candidate.instruction(problem.simulation), problem.labels)


def varied_by(candidate: Candidate, problem: Problem) -> tuple[str, ...]:
    """Return the covariates that a candidate's experiment varies on this machine."""
    return as_it_runs(candidate.varied(problem), problem.simulation)


def as_it_runs(varied: tuple[str, ...], simulation: Predictor) -> tuple[str, ...]:
    """Return the covariates that are varied; what a reversal shows, several speeds show on one that runs one way."""
    if simulation.one_way and DIRECTION in varied:
        return tuple(name for name in varied if name != DIRECTION) or (SPEED,)
    return varied


def range_in_words(problem: Problem, setting: Setting) -> str:
    """Return between which values a covariate is varied."""
    least = NEXT_TO_NOTHING * max(abs(setting.low), abs(setting.high))
    rounded = (float(f"{each:.2g}") if abs(each) > least else 0.0 for each in (setting.low, setting.high))
    ends = " to ".join(f"{each:.6g}" for each in rounded)
    if setting.relative:
        read = problem.recording.channels.get(setting.channel)
        covariate = None if read is None else column_of(read, problem.covariates)
        told = problem.labels.get(covariate or "", label_of_column(setting.channel))
        return f"{told.split(' (')[0]} {ends} times the usual"
    unit = unit_in_label(setting.covariate, problem.labels)
    return f"{word_for(setting.covariate, problem.labels)} {ends} {unit}".strip()


def _expectation(choice: Choice, names: Collection[str]) -> str:
    """Return how well the closest pair is told apart, of which one may be a likely answer that is not in the set."""
    times = int(np.ceil(choice.needed / max(choice.margin, 1e-9) - AS_GOOD_AS_REACHED))
    told = f"{choice.needed:.0f} tells them apart nine times in ten" + (f": {times} times as long" if times > 1 else "")
    further = [name for name in choice.pair if name not in names]
    of_others = f" ({listed(further)} in another likely answer)" if further else ""
    closest = ", the closest two" if set(choice.pair) != set(names) else ""
    return f"Expected Δχ² between {listed(choice.pair)}{closest}{of_others}: {choice.margin:.0f} ({told})."


def _with_additions(
    members: Sequence[Term], names: tuple[str, ...], beside: Sequence[Addition]
) -> tuple[list[Term], tuple[str, ...]]:
    """Return all effects of a set, and all its names."""
    more = [addition.more for addition in beside]
    return [*members, *more], (*names, *(term.name for term in more))


def _own_experiments(
    names: tuple[str, ...],
    experimenter: Experimenter,
    given: Sequence[Term],
    members: Sequence[Term],
    beside: Sequence[Addition],
) -> Indistinguishable:
    """Return a set with the experiments that its members' candidates state, where none can be predicted.

    Where the simulation's free parameters can imitate a member, a part without load is added: there they have no part.
    """
    members, names = _with_additions(members, names, beside)
    equations = experimenter.equations
    problem = equations.problem
    candidates = [member.group.candidate for member in members if member.group.candidate is not None]
    drives = [_instruction(candidate, problem) for candidate in candidates]
    unloaded = problem.simulation.unloaded_experiment
    hidden = any(_imitated(equations, given, member) for member in members)
    lift = bool(unloaded) and (hidden or any(candidate.run_unloaded for candidate in candidates))
    sentence = "; then ".join(dict.fromkeys([*drives, unloaded] if lift else drives))
    duration_s, in_all = rounded_up(seconds_needed(equations, experimenter.entry_threshold))
    why = experimenter.unpredictable or "none of the experiments that can be simulated here does"
    return Indistinguishable(
        effects=names,
        beside=tuple(addition.more.name for addition in beside),
        experiment=f"{capital(sentence)}; {in_all} in all. How well that tells them apart is not predicted: {why}.",
        vary=tuple(dict.fromkeys(name for candidate in candidates for name in varied_by(candidate, problem))),
        duration_s=duration_s,
        lift=lift,
        channel=problem.simulation.channel,
    )


def _terms(others: Sequence[Alternative]) -> list[Term]:
    return [term for other in others for term in other.terms if term.group.named]


def _imitated(equations: NormalEquations, given: Sequence[Term], member: Term) -> bool:
    """Return whether free parameters can imitate most of a member that is there without load too."""
    candidate, least = member.group.candidate, equations.thresholds.experiment_tolerance
    return candidate is not None and candidate.acts_unloaded and equations.tolerance(given, member) < least


def seconds_needed(equations: NormalEquations, entry_threshold: float) -> float:
    """Return how long an experiment that is not predicted must last to show the smallest effect nine times in ten [s].

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
