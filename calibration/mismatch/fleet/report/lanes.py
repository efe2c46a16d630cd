"""The lanes of a season's drawing: a rover's effects, what it shows that no candidate explains, or nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer, FleetEffect, RoverOfFleet
    from regolithd.calibration.mismatch.report.labels import Labels

ACTS, ABSENT, UNEXPLAINED = "before", "absent", "unknown"
"""Classes of a recording's mark in the style sheet: an effect acts, does not act, or something is unexplained."""


@dataclass(frozen=True)
class Lane:
    """One line of the drawing.

    Attributes
    ----------
    rover, label: whose it is, and what it shows
    marks: the class of each recording of the rover
    since_low, since, since_high, until: dates of the answer; None: it has none
    """

    rover: str
    label: str
    marks: Mapping[str, str]
    since_low: str | None = None
    since: str | None = None
    since_high: str | None = None
    until: str | None = None


def lanes_of(answer: FleetAnswer, labels: Labels, wheels: Sequence[int | str], most_rovers: int) -> list[Lane]:
    """Return the lanes of at most so many rovers: where there are more, of those with the most findings."""
    of_rover = {rover.name: list(_lanes(rover, answer, labels, wheels)) for rover in answer.rovers}
    drawn = sorted(of_rover, key=lambda name: -sum(_shows(lane) for lane in of_rover[name]))[:most_rovers]
    return [lane for name, lanes in of_rover.items() if name in drawn for lane in lanes]


def _shows(lane: Lane) -> bool:
    return any(kind != ABSENT for kind in lane.marks.values())


def _lanes(rover: RoverOfFleet, answer: FleetAnswer, labels: Labels, wheels: Sequence[int | str]) -> Iterator[Lane]:
    found = False
    # What single recordings show of one kind on the same wheels is one lane.
    acting: dict[tuple[str, tuple[int | str, ...], str], list[FleetEffect]] = {}
    for effect in answer.effects:
        if rover.name in effect.rovers:
            acting.setdefault((effect.name, effect.wheels, effect.channel), []).append(effect)
    for (name, on, _), effects in acting.items():
        found = True
        where = f", {labels.wheels(on, wheels)}" if len(on) < len(wheels) else ""
        acts = {recording for effect in effects for recording in effect.recordings}
        marks = {each: ACTS if each in acts else ABSENT for each in rover.recordings}
        only = effects[0] if len(effects) == 1 else None
        dates = (only.since_low, only.since, only.since_high, only.until) if only else ()
        yield Lane(rover.name, labels.effect(name) + where, marks, *dates)
    rest = {name for place in answer.unexplained for name in place.recordings if name in rover.recordings}
    if rest:
        yield Lane(
            rover.name, "unexplained", {each: UNEXPLAINED if each in rest else ABSENT for each in rover.recordings}
        )
    elif not found:
        yield Lane(rover.name, "nothing found", dict.fromkeys(rover.recordings, ABSENT))
