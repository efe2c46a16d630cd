"""What the sequential test reports after an interval: what has begun, where, since when, how large, and how sure."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.mismatch.inference.rounding import with_interval
from regolithd.calibration.mismatch.inference.statements import on_wheels
from regolithd.calibration.mismatch.problem.words import in_words
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.online.left_out import LeftOutReadings
    from regolithd.calibration.mismatch.online.linearised import Linearised
    from regolithd.calibration.mismatch.online.scores import Place, Scores
    from regolithd.calibration.mismatch.online.unnamed import Unnamed

UNNAMED = "unexplained"
"""The name of a change that no single law explains."""
UNNAMED_WORDS = "something has begun, not known what: no single effect explains it"
WHOLE_DECIDES = "Sequential test while the recording grows; the comparison of the whole recording decides"
"""Ends each statement: names need the whole recording."""


@dataclass(frozen=True)
class Rival:
    """What explains a change nearly as well."""

    name: str
    wheels: tuple[int | str, ...]


@dataclass(frozen=True)
class Change:
    """A change that was reported.

    Attributes
    ----------
    name: the law's, or `UNNAMED`
    onset_s: when it began; None: it was there from the start
    onset_low_s, onset_high_s: 90 % interval of that
    size, low, high: of the law's coefficient, with a 90 % interval, in `unit`; without a name, the root mean square
    statistic: Δχ²
    first_reported_s: when it was reported first
    rivals: other names or wheels that explain it nearly as well
    """

    name: str
    wheels: tuple[int | str, ...]
    onset_s: float | None
    onset_low_s: float | None
    onset_high_s: float | None
    parameter: str
    size: float
    low: float
    high: float
    unit: str
    statistic: float
    first_reported_s: float
    rivals: tuple[Rival, ...]
    statement: str


@dataclass(frozen=True)
class Report:
    """What is known after an interval.

    Attributes
    ----------
    time_s: its end, from the recording's start
    learning: whether the first intervals are still being collected
    compared_intervals: how many have been compared
    not_compared: why this one was not; empty: it was
    leading: the largest Δχ² of what is not reported, to be held against `alarm`
    left_out: candidates that are not looked for: the beginning of the recording did not show what they depend on, or
        they need the whole recording
    left_out_readings: of wheels that are not compared while others are, with the reason
    """

    time_s: float
    learning: bool
    compared_intervals: int
    not_compared: str
    leading: float
    alarm: float
    changes: tuple[Change, ...]
    left_out: tuple[str, ...]
    left_out_readings: tuple[LeftOutReadings, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return a JSON object."""
        return asdict(self)


def change_of(found: Linearised, place: Place, beside: Scores, at_s: float, interval_s: float) -> Change:
    """Return a reported change in words and numbers; `beside` are the scores beside the other changes."""
    law = found.laws[place.law]
    segment, chosen, k = at = beside.at(place)
    statistic, size = float(beside.statistic[at]), float(beside.size[at])
    reach = NINETY_PERCENT_STDS * float(beside.std[at])
    near = beside.statistic[:, chosen, k] > statistic - THRESHOLDS.onset_fall
    low_s, high_s = _interval(beside.starts_s, near, segment, interval_s)
    begun = segment > 0
    change = Change(
        name=law.name,
        wheels=_names(found, place.wheels),
        onset_s=place.onset_s if begun else None,
        onset_low_s=low_s if begun else None,
        onset_high_s=high_s if begun else None,
        parameter=law.parameter,
        size=size,
        low=size - reach,
        high=size + reach,
        unit=law.unit,
        statistic=statistic,
        first_reported_s=at_s,
        rivals=_rivals(found, place, beside, statistic),
        statement="",
    )
    words = in_words(law.candidate.words, found.simulation.covariate_labels)
    return replace(change, statement=_statement(change, found, words))


def unnamed_change(found: Linearised, wheels: int, together: Unnamed, at_s: float, interval_s: float) -> Change:
    """Return a reported change that has no name, on a set of wheels; its size is a root mean square."""
    segment = int(np.argmax(together.score))
    statistic, information = float(together.statistic[segment]), max(float(together.information[segment]), 1e-300)
    size, reach = np.sqrt(statistic / information), NINETY_PERCENT_STDS / np.sqrt(information)
    near = together.score > together.score[segment] - THRESHOLDS.onset_fall
    low_s, high_s = _interval(together.starts_s, near, segment, interval_s)
    begun = segment > 0
    change = Change(
        name=UNNAMED,
        wheels=_names(found, wheels),
        onset_s=float(together.starts_s[segment]) if begun else None,
        onset_low_s=low_s if begun else None,
        onset_high_s=high_s if begun else None,
        parameter="root_mean_square",
        size=float(size),
        low=float(max(size - reach, 0.0)),
        high=float(size + reach),
        unit=found.simulation.unit,
        statistic=statistic,
        first_reported_s=at_s,
        rivals=(),
        statement="",
    )
    return replace(change, statement=_statement(change, found, UNNAMED_WORDS))


def _statement(change: Change, found: Linearised, words: str) -> str:
    where = on_wheels(change.wheels, len(found.wheels), found.simulation.wheel_column)
    since = (
        f"since {change.onset_s:.0f} s (90 % sure: {change.onset_low_s:.0f} to {change.onset_high_s:.0f} s)"
        if change.onset_s is not None
        else "from the start"
    )
    size, low, high = with_interval(change.size, change.low, change.high)
    names = ", ".join(dict.fromkeys(rival.name for rival in change.rivals if rival.name != change.name))
    return (
        f"{words[:1].upper()}{words[1:]}{where}, {since}: {size} {change.unit} "
        f"{'root mean square ' if change.name == UNNAMED else ''}"
        f"(90 % sure: {low} to {high})"
        f"{f'; or {names}, which explains it nearly as well' if names else ''}. {WHOLE_DECIDES}."
    )


def _names(found: Linearised, wheels: int) -> tuple[int | str, ...]:
    return tuple(found.wheels[w] for w in found.sets[wheels])


def _interval(
    starts_s: NDArray[np.float64], near: NDArray[np.bool_], at: int, interval_s: float
) -> tuple[float, float]:
    """Return the onsets about the best that are nearly as good, with what the resolution leaves open on both sides."""
    low = high = at
    while low > 0 and near[low - 1]:
        low -= 1
    while high + 1 < len(near) and near[high + 1]:
        high += 1
    before = float(starts_s[low - 1]) if low > 0 else float(starts_s[0])
    after = float(starts_s[high + 1]) if high + 1 < len(starts_s) else float(starts_s[high]) + interval_s
    return before, after


def _rivals(found: Linearised, place: Place, beside: Scores, statistic: float) -> tuple[Rival, ...]:
    """Return the other laws and sets of wheels whose best onset is within the margin of chance."""
    best = beside.statistic.max(axis=0)
    near = np.argwhere(best > statistic - THRESHOLDS.lead_margin)
    order = sorted(near.tolist(), key=lambda pair: -best[tuple(pair)])
    return tuple(Rival(found.laws[k].name, _names(found, s)) for s, k in order if (s, k) != (place.wheels, place.law))
