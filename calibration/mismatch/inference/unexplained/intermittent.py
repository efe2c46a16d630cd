"""A residual whose mean switches: something comes and goes, which no law of a covariate describes.

A cable that rubs now and then, a valve that sticks three times, or an hour of tail wind adds to some readings alone.
Its mean resembles a constant friction or offset; its spells lengthen the noise's memory, in which they would be lost.
They are told from noise by their two levels (`signal/intermittency/switching_mean.py`); few large ones, of any course,
by their skewness (`signal/intermittency/skewness.py`), and such that parameters have bent by their jumps
(`signal/intermittency/jumps.py`). Where the simulation has a state, what comes and goes may act on that (a mist that
cools a greenhouse), and the readings follow it slowly: it is looked for in what acted on the state, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import LONGEST_STEP
from regolithd.calibration.mismatch.problem.state.state_memory import before_state, memory_s
from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.regression.groups.smooth_groups import curves_over_time
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.decision import Intermittent
from regolithd.calibration.mismatch.selection.smooth_terms import drop_what_gains_little
from regolithd.calibration.mismatch.signal.intermittency.jumps import jumps, levels
from regolithd.calibration.mismatch.signal.intermittency.means import block_means
from regolithd.calibration.mismatch.signal.intermittency.skewness import skewed_lengths
from regolithd.calibration.mismatch.signal.intermittency.spells import levelled_spells, skewed_spells, switching_spells
from regolithd.calibration.mismatch.signal.intermittency.switching_mean import (
    FEWEST_PEERS,
    block_lengths,
    gain_as_noise,
    switching_mean,
)
from regolithd.calibration.mismatch.signal.noise_models.local_size import of_usual_noise

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TimedSpells:
    """Spells on some wheels.

    Attributes
    ----------
    from_s, to_s: begin of the first and end of the last
    share: of the power of what is left without them
    gain: twice the logarithm of the likelihood ratio to noise alone, less what the free numbers cost; 0: by skewness
    acting: how probably a reading is in a spell, times the factor by which it acts, shape (time, wheel); None: their
        course is not known
    """

    from_s: float
    to_s: float
    share: float
    gain: float
    acting: Array | None


LEAST_IN_BLOCKS = 1 / 2
"""Share of a curve's variance that its means over blocks have, from which on spells are a rival (a choice: most)."""
CONSTANT = frozenset({"direction", "none"})
"""Covariates of effects of constant size."""


def unexplained_if_intermittent(decision: Decision) -> Decision:
    """Return the decision with a curve over time unexplained on each wheel whose residual has spells.

    An effect of constant size that was named there is the mean of what comes and goes, and loses its name; so does one
    that gains little beside it. A curve over a covariate that is less likely than spells on its wheels imitates them.
    """
    equations, imitated = decision.equations, _imitated_spells(decision)
    kept = () if imitated else decision.unnamed
    explained = {wheel for term in kept for wheel in term.wheels}
    possible = imitated or wheels_with_spells(decision)
    in_spells = {wheels: each for wheels, each in possible.items() if explained.isdisjoint(wheels)}
    found = _with_curves(decision, in_spells) if in_spells else ()
    if not found:
        return decision
    curves = tuple(each.term for each in found)
    named = names_beside_spells(equations, decision.named.terms, curves)
    unnamed = (*kept, *curves)
    whole = equations.fit((*named.terms, *unnamed))
    return replace(decision, named=named, unnamed=unnamed, whole=whole, intermittent=found)


def _imitated_spells(decision: Decision) -> dict[tuple[int, ...], TimedSpells]:
    """Return what shows spells without the curve over a covariate that gains less than they do, nothing where none is.

    Both gains are twice a log likelihood ratio to noise, as it acts along the motion or as read, less what the free
    numbers cost. Where the covariate itself switches, it knows when, and its curve gains more. Spells are looked for in
    blocks of readings. A curve that changes from reading to reading hardly shows there, and imitates none.
    """
    curves = decision.unnamed
    if len(curves) != 1 or curves[0].name == "time" or curves[0].group.coupling in WITHOUT_CURVE:
        return {}
    (curve,) = curves
    without = _as_it_acts(replace(decision, unnamed=(), whole=decision.named))
    found = _spells_in(without)
    of_spells = sum(spells.gain for wheels, spells in found.items() if set(wheels) <= set(curve.wheels))
    if not of_spells:
        return {}
    courses = zip(without, _as_it_acts(decision), strict=True)
    of_curve = max(before.gain_of(after, curve.wheels) for before, after in courses)
    of_curve -= decision.equations.thresholds.coefficient_penalty * len(curve.group.columns)
    return found if of_spells > of_curve and _shows_in_blocks(decision, curve) else {}


def _shows_in_blocks(decision: Decision, curve: Term) -> bool:
    """Return whether means over the longest blocks in which spells are looked for have most of a curve's variance."""
    equations, whole = decision.equations, decision.whole
    acting = contribution(equations, whole, whole.terms.index(curve))
    courses = [acting[equations.problem.mask[:, wheel], wheel] for wheel in curve.wheels]
    in_blocks = sum(float(np.var(block_means(each, max(block_lengths(each))))) for each in courses)
    return in_blocks > LEAST_IN_BLOCKS * sum(float(np.var(each)) for each in courses)


def wheels_with_spells(decision: Decision) -> dict[tuple[int, ...], TimedSpells]:
    """Return the wheels on which the mean of what is left switches, as read or along the motion, and when.

    Each wheel is asked with the others' noise as evidence of what noise is like. Where several have spells, that is
    none: those that show them without it are several, too. Where none does, all are asked together: what acts on all
    adds up, and their noise does not.
    """
    return _spells_in(_as_it_acts(decision))


def _spells_in(as_it_acts: Sequence[_Courses]) -> dict[tuple[int, ...], TimedSpells]:
    """Return the wheels that show spells in one of these ways of acting."""
    every = as_it_acts[0].wheels
    found = _on_each(every, as_it_acts, with_peers=True)
    if len(found) < len(every) > FEWEST_PEERS:
        rest = [wheel for wheel in every if (wheel,) not in found]
        without_peers = _on_each(rest, as_it_acts, with_peers=False)
        found |= without_peers if len(found) + len(without_peers) > 1 else {}
    if len(every) > 1 and not found and (spells := _likeliest(courses.spells_on(every) for courses in as_it_acts)):
        found[every] = spells
    return found


def _as_it_acts(decision: Decision) -> list[_Courses]:
    """Return what is left as read, along the motion, and as it acted on a state before."""
    equations, problem = decision.equations, decision.equations.problem
    left = residual_of(equations, decision.whole)
    explained = np.zeros(left.shape)
    for index in range(len(decision.named.terms)):
        explained += contribution(equations, decision.named, index)
    if (reliability := equations.design.reliability) is not None:  # where readings scatter more, their mean is no spell
        left, explained = (each * equations.design.in_time(reliability.in_means) for each in (left, explained))
    direction = np.nan_to_num(problem.covariates.get("direction", np.ones(left.shape)))
    ways = (np.ones(left.shape), direction) if np.ptp(direction[problem.mask]) else (direction,)
    as_it_acts = [_Courses(problem, left, explained, along) for along in ways]
    if (memory := memory_s(problem)) > 0:
        (acted, known), (beside, _) = (before_state(problem, course, memory) for course in (left, explained))
        as_it_acts.append(_Courses(problem, acted, beside, known.astype(np.float64), as_read=False))
    return as_it_acts


def _on_each(
    wheels: Iterable[int], as_it_acts: Sequence[_Courses], *, with_peers: bool
) -> dict[tuple[int, ...], TimedSpells]:
    """Return those wheels that show spells, with these."""
    found: dict[tuple[int, ...], TimedSpells] = {}
    for wheel in wheels:
        spells = _likeliest(courses.spells_on((wheel,), with_peers=with_peers) for courses in as_it_acts)
        if spells:
            found[wheel,] = spells
    return found


def _likeliest(found: Iterable[TimedSpells | None]) -> TimedSpells | None:
    """Return the spells with the highest gain; of those without one, the largest."""
    return max((each for each in found if each), key=lambda each: (each.gain, each.share), default=None)


class _Courses:
    """What is left of each wheel, and what the named effects explain there, over the size of the noise.

    Parameters
    ----------
    left, explained: shape (time, wheel)
    along: factor of each reading, of the same shape: the direction, or 1; what it makes 0 is not looked at
    as_read: whether it acts on the readings, not on a state before them
    """

    def __init__(self, problem: Problem, left: Array, explained: Array, along: Array, *, as_read: bool = True) -> None:
        self._problem, self._left, self._explained, self._along = problem, left, explained, along
        self._read, self._as_read = problem.mask & (along != 0), as_read
        self._of_wheel = [self._of((wheel,)) for wheel in range(left.shape[1])]

    @property
    def wheels(self) -> tuple[int, ...]:
        """All wheels, by their indices."""
        return tuple(range(len(self._of_wheel)))

    def spells_on(self, wheels: tuple[int, ...], *, with_peers: bool = True) -> TimedSpells | None:
        """Return the spells in the sum of these wheels; small ones are the misfit of a named law.

        `with_peers`: whether the other wheels are evidence of what noise is like.
        """
        problem, limits = self._problem, self._problem.thresholds
        course, beside = self._of(wheels) if len(wheels) > 1 else self._of_wheel[wheels[0]]
        others = [wheel for wheel in self.wheels if with_peers and wheel not in wheels]
        switching = switching_mean(course, [self._of_wheel[wheel][0] for wheel in others], limits)
        acting = None
        if switching and switching.power > limits.form_misfit * np.mean(beside**2):
            gain, spells = switching.gain, switching_spells(course, switching)
            acting = self._acting(wheels, np.repeat(switching.acting(course), switching.block))
        elif lengths := skewed_lengths(course, beside, limits):
            spells = skewed_spells(course, lengths)
            gain = 0.0  # less than any two levels gain
        elif (at := self._jumps(wheels, course)).size:
            between = levels(course, at)
            spells, power = levelled_spells(course, at, between), float(np.var(between))
            # A jump has an instant and a size.
            gain = gain_as_noise(course, course - between) - 2 * limits.coefficient_penalty * len(at)
            if spells.share < limits.smooth_term_power or power <= limits.form_misfit * np.mean(beside**2):
                return None
        else:
            return None
        time_s = problem.time_s[self._read[:, list(wheels)].any(axis=1), 0]
        first, last = float(time_s[spells.first]), float(time_s[spells.last])
        return TimedSpells(first, last, spells.share, gain, acting)

    def _jumps(self, wheels: tuple[int, ...], course: Array) -> NDArray[np.int64]:
        """Return the readings of the course of these wheels with which another level begins."""
        breaks, limits = self._breaks(wheels), self._problem.thresholds
        found = jumps(course, breaks, thresholds=limits)
        # Most courses have none, of whatever size: what their readings are rounded to need not be known.
        return jumps(course, breaks, self._rounding(wheels, course), limits) if found.size else found

    def _breaks(self, wheels: tuple[int, ...]) -> NDArray[np.int64]:
        """Return which readings of a course follow no other: after a gap or a rest, in another run or another way."""
        recording, along = self._problem.recording, self._along[:, list(wheels)]
        at = np.flatnonzero(self._read[:, list(wheels)].any(axis=1))
        apart = np.diff(recording.time_s[at]) > LONGEST_STEP * recording.step_s
        apart |= (np.diff(recording.run[at]) != 0) | (np.diff(np.sign(along[at]), axis=0) != 0).any(axis=1)
        return np.flatnonzero(apart) + 1

    def _rounding(self, wheels: tuple[int, ...], course: Array) -> float:
        """Return twice the step between the values that readings of these wheels have, in the unit of their course."""
        on, read = list(wheels), self._read[:, list(wheels)]
        steps = [
            float(np.median(np.diff(values)))
            for k in range(len(on))
            if (values := np.unique(self._problem.measured[:, on][read[:, k], k])).size > 1
        ]
        size = float(np.sqrt(np.mean(self._left[:, on][read] ** 2))) if read.any() else 0.0
        return 2 * max(steps, default=0.0) * float(np.sqrt(np.mean(course**2))) / size if size > 0 else 0.0

    def gain_of(self, after: _Courses, wheels: Sequence[int]) -> float:
        """Return by how much the courses of some wheels are likelier to be noise after something was taken out."""
        pairs = [(self._of_wheel[wheel][0], after._of_wheel[wheel][0]) for wheel in wheels]
        return sum(gain_as_noise(course, rest) for course, rest in pairs if np.ptp(course) > 0)

    def _acting(self, wheels: tuple[int, ...], probability: Array) -> Array | None:
        """Return how probably a reading is in a spell (instant,), as it acts on these wheels, shape (time, wheel)."""
        if not self._as_read:
            return None
        acts = self._read & np.isin(np.arange(self._read.shape[1]), wheels)
        instants, course = np.flatnonzero(acts.any(axis=1)), np.zeros(len(acts))
        course[instants[: len(probability)]] = probability
        return np.where(acts, course[:, None] * self._along, 0.0)

    def _of(self, wheels: tuple[int, ...]) -> tuple[Array, Array]:
        on = list(wheels)
        left, explained, along = (each[:, on] for each in (self._left, self._explained, self._along))
        return of_usual_noise(left, explained, self._read[:, on], along, self._problem.thresholds)


def _with_curves(decision: Decision, in_spells: dict[tuple[int, ...], TimedSpells]) -> tuple[Intermittent, ...]:
    """Return the best curve over time on each of these sets of wheels, where it has one; a sine is no spells."""
    equations = decision.equations
    found = equations.further(decision.named.terms, curves_over_time(equations.design))
    found.sort(key=lambda gain_and_term: gain_and_term[0] - equations.penalty(gain_and_term[1]))
    curves = {term.wheels: term for _, term in found}
    return tuple(
        Intermittent(curves[wheels], spells.from_s, spells.to_s, spells.share)
        for wheels, spells in in_spells.items()
        if wheels in curves
    )


def names_beside_spells(equations: NormalEquations, terms: Sequence[Term], curves: Sequence[Term]) -> Fit:
    """Return the fit of those effects that are not the mean of what comes and goes, and gain enough beside it."""
    told = {wheel for curve in curves for wheel in curve.wheels}
    named = equations.fit([term for term in terms if not _constant_on(term, told)])
    for curve in curves:
        named = drop_what_gains_little(equations, named, curve)
    return named


def _constant_on(term: Term, wheels: set[int]) -> bool:
    """Return whether a named effect is of constant size on one of these wheels."""
    candidate = term.group.candidate
    return candidate is not None and candidate.covariate in CONSTANT and bool(wheels.intersection(term.wheels))
