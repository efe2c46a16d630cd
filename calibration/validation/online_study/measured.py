"""What is measured: the largest statistic of sound drives, and the delay of reports of drag."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.online.monitor import SequentialTest
from regolithd.calibration.validation.online_study.drives import other_noise

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.online.sums import Interval
    from regolithd.calibration.mismatch.online.thresholds import OnlineThresholds
    from regolithd.calibration.validation.online_study.drives import SoundDrive

Array = NDArray[np.float64]
SILENT = 1e6
"""A threshold that nothing passes."""
TAIL = 0.25
"""Share of the drives, those with the largest statistics, that the tail is fitted to (a choice)."""
HOURS_PER_FALSE_REPORT = 100.0


@dataclass(frozen=True)
class Delay:
    """One drive with drag.

    Attributes
    ----------
    share: of the mean current
    delay_s: from the onset to the first report; None: none before the end of the drive
    named: whether that report was of the right wheel, whatever it was called
    bound_s: Lorden's lower bound of the mean delay at this rate of false reports: ln of the intervals between two of
        them over the Kullback-Leibler information of an interval, by the statistic at the end of the drive
    """

    share: float
    delay_s: float | None
    named: bool
    bound_s: float


@dataclass(frozen=True)
class Offline:
    """What the comparison of the whole recording answers: right name and wheel, and the error of its onset."""

    share: float
    found: bool
    onset_error_s: float | None


def highest(drive: SoundDrive, rng: np.random.Generator, draws: int, limits: OnlineThresholds) -> list[float]:
    """Return the largest statistic of a sound drive with its own noise and with others."""
    silent = replace(limits, alarm=SILENT, leading_share=limits.leading_share * limits.alarm / SILENT)
    found = []
    for draw in range(draws):
        current = other_noise(rng, drive) if draw else drive.trial.current_A
        found.append(max(test.leading for test, _ in _decided(drive, drive.with_current(current), silent)))
    return found


def alarm_for(largest: Array, hours: float) -> tuple[float, float]:
    """Return the threshold for one false report in 100 h, and its standard error by the bootstrap.

    `largest` are the largest statistics of sound drives of `hours` each. Their tail is exponential: the rate of reports
    falls by e with each so many units of the threshold, which the largest quarter shows.
    """
    rng = np.random.default_rng(0)
    draws = [_alarm(rng.choice(largest, len(largest)), hours) for _ in range(400)]
    return _alarm(largest, hours), float(np.std(draws))


def _alarm(largest: Array, hours: float) -> float:
    start = float(np.quantile(largest, 1 - TAIL))
    scale = float(np.mean(largest[largest > start] - start))
    return start + scale * float(np.log(TAIL * HOURS_PER_FALSE_REPORT / hours))


def delay_of(drive: SoundDrive, wheel: int, share: float, onset_s: float, limits: OnlineThresholds) -> Delay:
    """Return when drag that begins at an onset is reported."""
    intervals = drive.with_current(drive.dragging(wheel, share, onset_s))
    delay, named, statistic = None, False, 0.0
    for test, now_s in _decided(drive, intervals, limits):
        if test.reported:
            scores = test.scores_beside(0)
            statistic = float(scores.statistic.max())
        if test.reported and delay is None and now_s > onset_s:
            delay = now_s - onset_s
            place = test.reported[0].place
            named = drive.linearised.sets[place.wheels] == (wheel - 1,)
    per_interval = statistic / ((intervals[-1].end_s - onset_s) / limits.interval_s) / 2
    intervals_per_false_report = HOURS_PER_FALSE_REPORT * 3600 / limits.interval_s
    bound = np.log(intervals_per_false_report) / per_interval * limits.interval_s if statistic else float("inf")
    return Delay(share, delay, named, float(bound))


def offline(drive: SoundDrive, wheel: int, share: float, onset_s: float) -> Offline:
    """Return what the comparison of the whole recording says of the same drag."""
    recording = drive.recording(drive.dragging(wheel, share, onset_s))
    effects = compare(recording, drive.simulation).answer.effects
    right = [each for each in effects if each.name == "bearing-drag" and each.wheels == (wheel,)]
    onset = right[0].onset_s if right else None
    found = bool(right) and len(effects) == 1
    return Offline(share, found, None if onset is None else abs(onset - onset_s))


def _decided(
    drive: SoundDrive, intervals: Sequence[Interval], limits: OnlineThresholds
) -> Iterator[tuple[SequentialTest, float]]:
    """Yield the test after each interval that it decides on, and the time."""
    test = SequentialTest(drive.linearised, limits)
    test.learn(list(intervals[: limits.learning_intervals]))
    for interval in intervals[limits.learning_intervals :]:
        test.add(interval)
        yield test, interval.end_s
