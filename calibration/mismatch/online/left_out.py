"""Readings that are left out of the comparison while a recording grows: of which wheel, why, and since when.

The reason is found from the rows as they were recorded: in a long gap of an input the prediction has none to be bridged
from, and is blank itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.statements import noun_before
from regolithd.calibration.mismatch.problem.words import word_for
from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.online.thresholds import OnlineThresholds
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STAYS = "stays exactly the same while its prediction changes"


@dataclass(frozen=True)
class LeftOutHere:
    """Readings of one wheel that are left out of an interval, for one reason.

    Attributes
    ----------
    wheel: its index
    readings: how many of the instants at which anything is predicted
    share: of these instants
    first_s: the first of them, from the recording's start
    """

    wheel: int
    reason: str
    readings: int
    share: float
    first_s: float


@dataclass(frozen=True)
class LeftOutReadings:
    """Readings of one wheel that have been left out so far, for one reason.

    Attributes
    ----------
    readings: how many
    since_s: since when most of them are, where that has lasted for `OnlineThresholds.lasting_intervals`; None: it has
        not, or is over
    """

    wheel: int | str
    reason: str
    readings: int
    since_s: float | None

    def statement(self, kind: str) -> str:
        """Return it in words; `kind` is the column that tells wheels apart."""
        wheel = f"{noun_before([self.wheel], kind)}{self.wheel}"
        return f"{wheel} is not compared since {self.since_s:.0f} s: {self.reason}"


@dataclass(frozen=True, eq=False)
class Usual:
    """How the readings of each wheel were at the beginning, shape (wheel,) each.

    Attributes
    ----------
    deviation: of the residual; 0: not known
    repeats: share of readings that are exactly the one before, as with a coarse resolution
    """

    deviation: Array
    repeats: Array


def usual_of(problem: Problem) -> Usual:
    """Return how the readings of a problem are; of what never repeats, as if once more had."""
    deviation, repeats = [], []
    for k, known in enumerate(problem.mask.T):
        same = np.diff(problem.measured[known, k]) == 0
        deviation.append(robust_std(problem.residual[known, k]))
        repeats.append((same.sum() + 1) / (same.size + 1))
    return Usual(np.array(deviation), np.array(repeats))


def stuck(problem: Problem, elapsed: Array, usual: Usual, limits: OnlineThresholds) -> Mask:
    """Return where a reading stays exactly the same while the prediction changes, shape (time, wheel).

    `elapsed` is the time of each row [s]. A reading whose steps are coarse often repeats, and is not taken for a stuck
    one; nor is one that rightly stays at 0.
    """
    found = np.zeros(problem.measured.shape, np.bool_)
    for k, (scale, repeats) in enumerate(zip(usual.deviation, usual.repeats, strict=True)):
        rows = np.flatnonzero(np.isfinite(problem.measured[:, k]) & np.isfinite(problem.prediction[:, k]))
        steps = np.flatnonzero(np.diff(problem.measured[rows, k]) != 0) + 1
        for same in np.split(rows, steps):
            long = len(same) > 1 and elapsed[same[-1]] - elapsed[same[0]] >= limits.stuck_s
            if long and scale > 0 and repeats ** (len(same) - 1) < limits.stuck_level:
                found[same, k] = np.ptp(problem.prediction[same, k]) > limits.stuck_range * scale
    return found


def reasons_of(problem: Problem, recorded: Recording, stays: Mask) -> Iterator[tuple[str, Mask]]:
    """Yield each reason with where it applies, shape (time, wheel), the most particular first."""
    simulation = problem.simulation
    yield f"{simulation.channel} was not measured", ~np.isfinite(recorded.channel(simulation.channel))
    for name in simulation.inputs:
        blank = ~np.isfinite(recorded.channel(name)) if name in recorded.channels else np.zeros_like(stays)
        yield f"{name} was not measured", blank | ~np.isfinite(problem.recording.channel(name))
    yield f"{simulation.channel} {STAYS}", stays
    yield "the simulation predicts nothing there", ~np.isfinite(problem.prediction)
    for name, values in problem.covariates.items():
        if np.isfinite(values).any():
            yield f"{word_for(name, problem.labels)} was not measured", ~np.isfinite(values)
    yield "a column that it needs was blank just before, or the reading is far outside of all others", ~stays


def left_out_of(
    reasons: Iterator[tuple[str, Mask]], mask: Mask, instants: Mask, elapsed: Array
) -> tuple[LeftOutHere, ...]:
    """Return what is left out of an interval, by wheel and by the first reason that applies.

    Parameters
    ----------
    mask: where readings are compared, shape (time, wheel)
    instants: of the interval, at which anything is predicted, shape (time,): at others the machine stands
    """
    left, found = instants[:, None] & ~mask, []
    for reason, where in reasons:
        for wheel in np.flatnonzero((left & where).any(axis=0)):
            rows = np.flatnonzero(left[:, wheel] & where[:, wheel])
            share = len(rows) / int(instants.sum())
            found.append(LeftOutHere(int(wheel), reason, len(rows), share, float(elapsed[rows[0]])))
        left &= ~where
    return tuple(found)


def since_before(left_out: Sequence[LeftOutHere], earlier: Mask, elapsed: Array) -> tuple[LeftOutHere, ...]:
    """Return what is left out with the first instant of what is stuck since the interval before.

    `earlier` is where that is, shape (time, wheel), `elapsed` the times of these rows and of those after.
    """
    return tuple(
        replace(each, first_s=float(elapsed[np.argmax(earlier[:, each.wheel])]))
        if each.reason.endswith(STAYS) and earlier[:, each.wheel].any()
        else each
        for each in left_out
    )


@dataclass
class LeftOutCount:
    """Counts what is left out, and since when most of a wheel's readings are."""

    wheels: Sequence[int | str]
    limits: OnlineThresholds
    _readings: dict[tuple[int, str], int] = field(default_factory=dict)
    _since: dict[tuple[int, str], tuple[float, int]] = field(default_factory=dict)

    def add(self, left_out: Sequence[LeftOutHere]) -> None:
        """Take what is left out of the next interval."""
        since = {}
        for each in left_out:
            key = (each.wheel, each.reason)
            self._readings[key] = self._readings.get(key, 0) + each.readings
            if each.share >= self.limits.mostly_share:
                first_s, lasted = self._since.get(key, (each.first_s, 0))
                since[key] = (first_s, lasted + 1)
        self._since = since

    def table(self) -> tuple[LeftOutReadings, ...]:
        """Return what has been left out so far."""
        return tuple(
            LeftOutReadings(self.wheels[wheel], reason, readings, self._lasting_since(wheel, reason))
            for (wheel, reason), readings in self._readings.items()
        )

    def _lasting_since(self, wheel: int, reason: str) -> float | None:
        first_s, lasted = self._since.get((wheel, reason), (0.0, 0))
        return first_s if lasted >= self.limits.lasting_intervals else None
