"""The sequential test of a recording while it grows: pieces in, after each a report of what has begun."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.mismatch.online.left_out import LeftOutCount
from regolithd.calibration.mismatch.online.linearised import Linearised, check_comparable, learned
from regolithd.calibration.mismatch.online.noise import NoiseHistory
from regolithd.calibration.mismatch.online.report import Change, Report, change_of, unnamed_change
from regolithd.calibration.mismatch.online.scores import Place, Scores, fitted_with, scores
from regolithd.calibration.mismatch.online.sums import Course, Interval, Suffixes, sums_of
from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS, OnlineThresholds
from regolithd.calibration.mismatch.online.unnamed import Unnamed, lacks_fit, unnamed
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.online.pieces import Piece
    from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]
LEVEL = THRESHOLDS.single_test_level
"""Of the test whether a law is enough."""


@dataclass(frozen=True)
class Reported:
    """A change that was reported.

    Attributes
    ----------
    place: what is told of it; of one without a name, its wheels and its onset
    at_s: when it was reported first
    possible: the laws and wheels, by their indices, that have explained it nearly as well ever since; empty: all are
        refuted
    named: whether one law explains it: once that is refuted, it stays unnamed
    """

    place: Place
    at_s: float
    possible: frozenset[tuple[int, int]]
    named: bool = True


class SequentialTest:
    """Keeps the sums of a recording, and decides after each interval. No input or output, no clock.

    Attributes
    ----------
    leading: the largest Δχ² of a change that is not reported yet, after the last interval
    reported: the changes that are
    noise: as estimated after the last interval
    """

    def __init__(self, linearised: Linearised, thresholds: OnlineThresholds = ONLINE_THRESHOLDS) -> None:
        self._linearised = linearised
        self._limits = thresholds
        self._course = Course(thresholds.most_segments)
        self._history = NoiseHistory(thresholds.history_intervals)
        self.leading = 0.0
        self.reported: tuple[Reported, ...] = ()
        self.noise: NoiseModel | None = None
        self._best: Place | None = None
        self._last: Interval | None = None

    def learn(self, intervals: list[Interval]) -> None:
        """Take the first intervals: the noise is what is left by their own fit."""
        for interval in intervals:
            self._sum(interval)
        unit = np.ones(len(self._linearised.wheels))
        provisional = unit / max(np.mean([np.mean(each.residual[each.mask] ** 2) for each in intervals]), 1e-300)
        for weights in (provisional, None):
            used = weights if weights is not None else self._weights()
            coefficients = self._coefficients(self._course.suffixes(), used, ())
            self._history.clear()
            for interval in intervals:
                self._history.add(interval, coefficients)
            self.noise = self._history.model()
        self._last = intervals[-1]

    def add(self, interval: Interval) -> None:
        """Take the next interval, decide, and count as noise what neither reported nor leading changes explain.

        The interval that is decided on has no part in the noise that it is held against: a change would hide itself.
        """
        self._revise(interval)
        self._sum(interval)
        self._decide(interval.end_s)
        self._count_as_noise(interval)
        self._last = interval

    def scores_beside(self, index: int) -> Scores:
        """Return the scores beside all reported changes but one."""
        sums, named = self._others(index)
        return scores(sums, self._weights(), self._linearised.search, named)

    def unnamed_beside(self, index: int, wheels: int | None = None) -> Unnamed:
        """Return what all columns explain on the wheels of a reported change, or on others, beside the others."""
        sums, named = self._others(index)
        on = self.reported[index].place.wheels if wheels is None else wheels
        return unnamed(sums, self._weights(), self._linearised.search, named, on, LEVEL)

    def _others(self, index: int | None = None) -> tuple[Suffixes, list[Place]]:
        """Return the sums and the places of all reported changes but one; what has no name is left out of the sums."""
        sums = self._course.suffixes()
        others = [each for k, each in enumerate(self.reported) if k != index]
        for each in others:
            if not each.named:
                sums = sums.without(self._linearised.sets[each.place.wheels], each.place.onset_s)
        return sums, [each.place for each in others if each.named]

    def _revise(self, following: Interval) -> None:
        """Leave readings out of the last interval, which the following one shows to be stuck."""
        stuck, last = following.stuck_before, self._last
        if stuck is None or last is None or last.end_s != following.start_s or not (last.mask & stuck).any():
            return
        self._last = last.without(stuck)
        self._course.replace_last(sums_of(self._last))
        self._history.drop_last()
        self._count_as_noise(self._last)

    def _sum(self, interval: Interval) -> None:
        kept = {each.place.onset_s for each in self.reported}
        self._course.add(interval.start_s, sums_of(interval), kept)

    def _count_as_noise(self, interval: Interval) -> None:
        sums, places = self._others()
        if self._best and self.leading > self._limits.leading_share * self._limits.alarm:
            places.append(self._best)
        for each in self.reported:
            if not each.named and each.place.onset_s <= interval.start_s:
                interval = interval.without(self._linearised.search.member[each.place.wheels] > 0)
        self._history.add(interval, self._coefficients(sums, self._weights(), tuple(places)))
        self.noise = self._history.model()

    def _weights(self) -> Array:
        assert self.noise is not None  # noqa: S101  # `learn` has been called
        return self.noise.weights

    def _coefficients(self, suffixes: Suffixes, weights: Array, places: tuple[Place, ...]) -> Array:
        """Return what is fitted now, as coefficients of all columns, shape (column, wheel)."""
        search = self._linearised.search
        known = [place for place in places if place.onset_s in suffixes.starts_s]
        fitted = fitted_with(suffixes, weights, search, known).fitted
        tangents = len(search.precision)
        found = np.zeros((suffixes.gram.shape[2], len(self._linearised.wheels)))
        found[:tangents] = fitted[:tangents, None]
        for place, value in zip(known, fitted[tangents:], strict=True):
            found[tangents + place.law] += value * search.member[place.wheels]
        return found

    def _decide(self, now_s: float) -> None:
        """Look for each reported change again, beside the others, and then for further ones, until all have names.

        Or until those that no single law explains are unnamed: their readings count for nothing else.
        """
        for index in range(len(self.reported) - 1, -1, -1):
            again = self._again(index)
            self.reported = (*self.reported[:index], *([again] if again else []), *self.reported[index + 1 :])
        while True:
            self._look_further(now_s)
            refuted = [k for k, each in enumerate(self.reported) if each.named and self._nameless(k)]
            if not refuted:
                return
            self._take_name(refuted[0])

    def _look_further(self, now_s: float) -> None:
        limits = self._limits
        while True:
            sums, named = self._others()
            found = scores(sums, self._weights(), self._linearised.search, named)
            self._best = found.best()
            self.leading = float(found.statistic.max())
            if self.leading < limits.alarm or len(self.reported) >= limits.most_changes:
                return
            near = found.near(self._best, self._linearised.search.member, limits.together_s)
            self.reported = (*self.reported, Reported(self._best, now_s, self._within_lead(near)))

    def _within_lead(self, near: Array) -> frozenset[tuple[int, int]]:
        """Return the laws and wheels that are not refuted, of their Δχ², shape (set, law)."""
        held = np.argwhere(near > near.max() - self._limits.name_lead)
        return frozenset((int(law), int(wheels)) for wheels, law in held)

    def _again(self, index: int) -> Reported | None:
        """Return a reported change as it is now; None: it is withdrawn.

        Its name stays as long as no other is far ahead. Another may follow it that was nearly as good from the first
        report on; else it has none.
        """
        each, found = self.reported[index], self.scores_beside(index)
        search, limits = self._linearised.search, self._limits
        near = found.near(each.place, search.member, limits.together_s)
        place = found.best_of(each.place)
        own = float(found.statistic[found.at(place)]) if each.named else 0.0
        if max(own, near.max()) < limits.kept_share * limits.alarm:
            return None
        if not each.named:
            onset_s = self.unnamed_beside(index).onset_s()
            return replace(each, place=replace(each.place, onset_s=onset_s))
        if own > near.max() - limits.name_lead:
            return replace(each, place=place, possible=each.possible & (self._within_lead(near) | {_pair(place)}))
        possible = each.possible & self._within_lead(near)
        if not possible:
            return replace(each, possible=possible)
        law, wheels = max(possible, key=lambda pair: near[pair[1], pair[0]])
        return replace(each, place=found.best_of(Place(law, wheels, place.onset_s)), possible=possible)

    def _same_wheels_and_time(self, index: int) -> list[int]:
        """Return the other reported changes that begin on a wheel of this one at about its time."""
        sets, here = self._linearised.sets, self.reported[index].place
        return [
            k
            for k, other in enumerate(self.reported)
            if k != index
            and not set(sets[here.wheels]).isdisjoint(sets[other.place.wheels])
            and abs(other.place.onset_s - here.onset_s) <= self._limits.together_s
        ]

    def _nameless(self, index: int) -> bool:
        """Return whether no single law explains a reported change."""
        if not self.reported[index].possible or self._same_wheels_and_time(index):
            return True
        place, found, together = self.reported[index].place, self.scores_beside(index), self.unnamed_beside(index)
        at = found.at(place)
        return lacks_fit(float(found.statistic[at]), together, at[0], LEVEL, self._limits.inexact_share)

    def _take_name(self, index: int) -> None:
        """Make a change and those that begin with it one without a name, on the wheels that show it best.

        One of them that had no name already keeps its wheels and its onset, and gets those of the change as well: what
        has no name only grows, so that the two cannot take turns, and `_decide` ends.
        """
        each, together = self.reported[index], self._same_wheels_and_time(index)
        nameless = [self.reported[k].place for k in together if not self.reported[k].named]
        covered = [each.place, *nameless] if nameless else []
        self.reported = tuple(other for k, other in enumerate(self.reported) if k not in together)
        index, member = self.reported.index(each), self._linearised.search.member
        covers = np.all(member >= member[[place.wheels for place in covered]].max(axis=0, initial=0.0), axis=1)
        possible = np.flatnonzero(covers & (member @ member[each.place.wheels] > 0))
        tried = [(int(wheels), self.unnamed_beside(index, int(wheels))) for wheels in possible]
        wheels, best = max(tried, key=lambda one: float(one[1].score.max()))
        onset_s = min([best.onset_s(), *(place.onset_s for place in covered)])
        unnamed_now = replace(each, place=Place(each.place.law, wheels, onset_s), named=False)
        self.reported = (*self.reported[:index], unnamed_now, *self.reported[index + 1 :])


def _pair(place: Place) -> tuple[int, int]:
    return place.law, place.wheels


class Monitor:
    """Follows a recording of one channel piece by piece.

    Parameters
    ----------
    simulation: of one channel (`one_channel`)
    """

    def __init__(self, simulation: Simulation, thresholds: OnlineThresholds = ONLINE_THRESHOLDS) -> None:
        self._simulation = simulation
        self._limits = thresholds
        self._first: list[Piece] = []
        self._linearised: Linearised | None = None
        self._before: Piece | None = None
        self.test: SequentialTest | None = None
        self._compared = 0
        self._count = LeftOutCount((), thresholds)

    def add(self, piece: Piece) -> Report:
        """Take the next piece; return what is known after it.

        Raises
        ------
        SimulationError
            When the simulation cannot be followed piece by piece.
        """
        reason = piece.reason
        if piece.recording is not None:
            try:
                self._compare(piece)
            except RecordingError as error:
                reason = str(error)
        self._before = piece if piece.recording is not None else None
        return self._report(piece, reason)

    def _compare(self, piece: Piece) -> None:
        if self.test is None or self._linearised is None:
            check_comparable(piece, self._simulation)
            self._first.append(piece)
            self._learn()
            return
        interval = self._linearised.interval(piece, self._before)
        self._count.add(interval.left_out)
        self.test.add(interval)
        self._compared += 1

    def _learn(self) -> None:
        if len(self._first) < self._limits.learning_intervals:
            return
        self._linearised, intervals = learned(self._first, self._simulation, self._limits)
        self._count = LeftOutCount(self._linearised.wheels, self._limits)
        for interval in intervals:
            self._count.add(interval.left_out)
        self.test = SequentialTest(self._linearised, self._limits)
        self.test.learn(intervals)
        self._compared = len(intervals)
        self._first = []

    def _report(self, piece: Piece, reason: str) -> Report:
        found = self._linearised
        changes: tuple[Change, ...] = ()
        if self.test is not None and found is not None:
            test = self.test
            changes = tuple(
                change_of(found, each.place, test.scores_beside(index), each.at_s, self._limits.interval_s)
                if each.named
                else unnamed_change(
                    found, each.place.wheels, test.unnamed_beside(index), each.at_s, self._limits.interval_s
                )
                for index, each in enumerate(test.reported)
            )
        return Report(
            time_s=piece.end_s,
            learning=self.test is None,
            compared_intervals=self._compared,
            not_compared=reason,
            leading=self.test.leading if self.test else 0.0,
            alarm=self._limits.alarm,
            changes=changes,
            left_out=found.left_out if found else (),
            left_out_readings=self._count.table(),
        )
