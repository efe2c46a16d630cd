"""A residual that is skewed: something comes and goes, which no law of a covariate describes.

Noise is as often above its mean as below, however slowly it varies. A cable that rubs now and then, a valve that sticks
three times, or an hour of tail wind adds to one side alone: most readings have none of it, and some have much. Its mean
resembles a constant friction or offset; its spells lengthen the noise's memory, in which they would be lost. They show
in the mean over about their length, where the noise is smaller and they are not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.regression.smooth_groups import PERIODIC
from regolithd.calibration.mismatch.selection.decision import Intermittent
from regolithd.calibration.mismatch.signal.skewness import of_usual_noise, skewed_lengths
from regolithd.calibration.mismatch.signal.spells import spells_in

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

TimedSpells = tuple[float, float, float]
"""When the first spell begins and the last ends [s], and their share of the power."""
CONSTANT = frozenset({"direction", "none"})
"""Covariates of effects of constant size."""


def unexplained_if_intermittent(decision: Decision) -> Decision:
    """Return the decision with a curve over time unexplained on each wheel whose residual is skewed.

    An effect of constant size that was named there is the mean of what comes and goes, and loses its name.
    """
    equations = decision.equations
    explained = {wheel for term in decision.unnamed for wheel in term.wheels}
    skewed = {wheels: spells for wheels, spells in skewed_wheels(decision).items() if explained.isdisjoint(wheels)}
    found = _with_curves(decision, skewed) if skewed else ()
    if not found:
        return decision
    curves = tuple(each.term for each in found)
    told = {wheel for term in curves for wheel in term.wheels}
    named = equations.fit([term for term in decision.named.terms if not _constant_on(term, told)])
    unnamed = (*decision.unnamed, *curves)
    whole = equations.fit((*named.terms, *unnamed))
    return replace(decision, named=named, unnamed=unnamed, whole=whole, intermittent=found)


def skewed_wheels(decision: Decision) -> dict[tuple[int, ...], TimedSpells]:
    """Return the wheels on which what is left, as read or along the motion, is skewed by more than chance, and when.

    Each wheel is asked alone; where none shows it, all together: what acts on all adds up, and their noise does not.
    """
    equations, problem = decision.equations, decision.equations.problem
    left = residual_of(equations, decision.whole)
    explained = np.zeros(left.shape)
    for index in range(len(decision.named.terms)):
        explained += contribution(equations, decision.named, index)
    every = tuple(range(left.shape[1]))
    found: dict[tuple[int, ...], TimedSpells] = {}
    for wheels in ((wheel,) for wheel in every):
        if spells := _skewed(problem, left, explained, wheels):
            found[wheels] = spells
    if len(every) > 1 and not found and (spells := _skewed(problem, left, explained, every)):
        found[every] = spells
    return found


def _skewed(problem: Problem, left: Array, explained: Array, wheels: tuple[int, ...]) -> TimedSpells | None:
    """Return the spells in what is left of these wheels, if it is skewed as read or along the motion.

    Where it is both, they are told as they act: so that more of the power is on one side.
    """
    on, limits, found = list(wheels), problem.thresholds, []
    direction = np.nan_to_num(problem.covariates.get("direction", np.ones(left.shape)))
    for along in (np.ones(left.shape), direction):
        read = (problem.mask & (along != 0))[:, on]
        course, beside = of_usual_noise(left[:, on], explained[:, on], read, along[:, on], limits)
        if lengths := skewed_lengths(course, beside, limits):
            spells, time_s = spells_in(course, lengths), problem.time_s[read.any(axis=1), 0]
            found.append((float(time_s[spells.first]), float(time_s[spells.last]), spells.share))
    return max(found, key=lambda spells: spells[2], default=None)


def _with_curves(decision: Decision, skewed: dict[tuple[int, ...], TimedSpells]) -> tuple[Intermittent, ...]:
    """Return the best curve over time on each of these sets of wheels, where it has one; a sine is no spells."""
    equations = decision.equations
    over_time = [
        group
        for group in equations.design.groups
        if group.name == "time" and not group.named and group.coupling != PERIODIC
    ]
    found = equations.further(decision.named.terms, over_time)
    found.sort(key=lambda gain_and_term: gain_and_term[0] - equations.penalty(gain_and_term[1]))
    curves = {term.wheels: term for _, term in found}
    return tuple(Intermittent(curves[wheels], *spells) for wheels, spells in skewed.items() if wheels in curves)


def _constant_on(term: Term, wheels: set[int]) -> bool:
    """Return whether a named effect is of constant size on one of these wheels."""
    candidate = term.group.candidate
    return candidate is not None and candidate.covariate in CONSTANT and bool(wheels.intersection(term.wheels))
