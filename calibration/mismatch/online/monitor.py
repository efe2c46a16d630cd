"""The sequential test of a recording while it grows: pieces in, after each a report of what has begun."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.mismatch.online.linearised import Linearised, check_comparable, learned
from regolithd.calibration.mismatch.online.noise import NoiseHistory
from regolithd.calibration.mismatch.online.report import Change, Report, change_of
from regolithd.calibration.mismatch.online.scores import Place, Scores, fitted_beside, scores
from regolithd.calibration.mismatch.online.sums import Course, Interval, Suffixes, sums_of
from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS, OnlineThresholds

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.online.pieces import Piece
    from regolithd.calibration.mismatch.signal.noise import NoiseModel
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reported:
    """A change that was reported: where, and at what time first."""

    place: Place
    at_s: float


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

    def add(self, interval: Interval) -> None:
        """Take the next interval, decide, and count as noise what neither reported nor leading changes explain.

        The interval that is decided on has no part in the noise that it is held against: a change would hide itself.
        """
        self._sum(interval)
        self._decide(interval.end_s)
        places = [each.place for each in self.reported]
        if self._best and self.leading > self._limits.leading_share * self._limits.alarm:
            places.append(self._best)
        self._history.add(interval, self._coefficients(self._course.suffixes(), self._weights(), tuple(places)))
        self.noise = self._history.model()

    def scores_beside(self, index: int) -> Scores:
        """Return the scores beside all reported changes but one."""
        return self._scores([other.place for k, other in enumerate(self.reported) if k != index])

    def _sum(self, interval: Interval) -> None:
        kept = {each.place.onset_s for each in self.reported}
        self._course.add(interval.start_s, sums_of(interval), kept)

    def _weights(self) -> Array:
        assert self.noise is not None  # noqa: S101  # `learn` has been called
        return self.noise.weights

    def _scores(self, beside: list[Place]) -> Scores:
        return scores(self._course.suffixes(), self._weights(), self._linearised.search, beside)

    def _coefficients(self, suffixes: Suffixes, weights: Array, places: tuple[Place, ...]) -> Array:
        """Return what is fitted now, as coefficients of all columns, shape (column, wheel)."""
        search = self._linearised.search
        known = [place for place in places if place.onset_s in suffixes.starts_s]
        fitted = fitted_beside(suffixes, weights, search, known)
        tangents = len(search.precision)
        found = np.zeros((suffixes.gram.shape[2], len(self._linearised.wheels)))
        found[:tangents] = fitted[:tangents, None]
        for place, value in zip(known, fitted[tangents:], strict=True):
            found[tangents + place.law] += value * search.member[place.wheels]
        return found

    def _decide(self, now_s: float) -> None:
        """Look for each reported change again, beside the others, and then for further ones."""
        limits = self._limits
        for index in range(len(self.reported) - 1, -1, -1):
            found = self.scores_beside(index)
            place = found.best()
            kept = list(self.reported)
            if found.statistic[found.at(place)] < limits.kept_share * limits.alarm:
                del kept[index]
            else:
                kept[index] = replace(kept[index], place=place)
            self.reported = tuple(kept)
        while True:
            found = self._scores([each.place for each in self.reported])
            self._best = found.best()
            self.leading = float(found.statistic.max())
            if self.leading < limits.alarm or len(self.reported) >= limits.most_changes:
                return
            self.reported = (*self.reported, Reported(self._best, now_s))


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
        self.test.add(self._linearised.interval(piece, self._before))
        self._compared += 1

    def _learn(self) -> None:
        if len(self._first) < self._limits.learning_intervals:
            return
        self._linearised, intervals = learned(self._first, self._simulation)
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
        )
