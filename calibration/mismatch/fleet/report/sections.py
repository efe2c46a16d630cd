"""What each section of a fleet's report shows: numbers and drawings, ready for the template."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from regolithd.calibration.mismatch.fleet.member import ONLY_ROVER
from regolithd.calibration.mismatch.fleet.report.figures import sizes_figure
from regolithd.calibration.mismatch.fleet.told.answer import to_the_minute
from regolithd.calibration.mismatch.inference.statements import capital, percent, plural
from regolithd.calibration.mismatch.report import sections, tables
from regolithd.calibration.mismatch.report.axes import number
from regolithd.calibration.mismatch.report.empirical import band_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow
    from regolithd.calibration.mismatch.fleet.report.season import Season
    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer, FleetEffect
    from regolithd.calibration.mismatch.report.labels import Labels

MOST_EFFECTS = 20
"""Effects with a section of their own (a choice); all are in the answer and in the catalogue."""
MOST_PANELS = 6
"""Rovers whose sizes are drawn for one effect (a choice: a page)."""


@dataclass(frozen=True)
class FleetEffectSection:
    """An effect, and its size in each recording alone; no drawing of what one recording shows."""

    effect: sections.EffectSection
    sizes: Markup
    not_drawn: int


@dataclass(frozen=True)
class UnexplainedRow:
    """What no candidate explains in one recording, or in several that have it in common."""

    rover: str
    recording: str
    covariate: str
    where: str
    when: str
    share: str


@dataclass(frozen=True)
class CurveSection:
    """A curve that recordings have in common: over what and in which, and its drawing."""

    title: str
    svg: Markup


@dataclass(frozen=True)
class ParameterOfRover:
    """A calibrated parameter, and whose it is."""

    rovers: str
    row: tables.CalibratedRow


@dataclass(frozen=True)
class RecordingRow:
    """A recording, and what the answer says of it."""

    rover: str
    name: str
    begins: str
    verdict: str


def summary(answer: FleetAnswer, labels: Labels, wheels: Sequence[int | str]) -> tuple[tuple[str, str], ...]:
    """Return what was compared, as pairs of a number and its noun."""
    recordings = sum(len(rover.recordings) for rover in answer.rovers)
    counts = [(len(answer.rovers), "rovers"), (recordings, "recordings"), (len(wheels), plural(labels.wheel))]
    return tuple((str(count), nouns) for count, nouns in counts if count > 1)


def period(answer: FleetAnswer) -> str:
    """Return from when to when the recordings began; empty where that is not known of all."""
    dates = [each for rover in answer.rovers for each in (rover.first, rover.last)]
    known = [each for each in dates if each]
    return f"{min(known)[:10]} to {max(known)[:10]}" if known and len(known) == len(dates) else ""


def effects(
    answer: FleetAnswer, rows: Sequence[CatalogueRow], season: Season, labels: Labels, wheels: Sequence[int | str]
) -> tuple[FleetEffectSection, ...]:
    """Return the first `MOST_EFFECTS` effects."""
    return tuple(_effect(each, answer, rows, season, labels, wheels) for each in answer.effects[:MOST_EFFECTS])


def _effect(
    found: FleetEffect,
    answer: FleetAnswer,
    rows: Sequence[CatalogueRow],
    season: Season,
    labels: Labels,
    wheels: Sequence[int | str],
) -> FleetEffectSection:
    own = [
        row
        for row in rows
        if row.found == "fleet"
        and row.effect == found.name
        and row.channel == found.channel
        and row.rover in found.rovers
        and row.wheel in set(map(str, found.wheels))
    ]
    section = sections.EffectSection(
        capital(labels.effect(found.name)),
        sections.unbroken(capital(found.statement)),
        found.equation,
        tuple(_facts(found, answer, labels, wheels)),
        sections.parameter_rows(found, labels),
    )
    drawn = found.rovers[:MOST_PANELS]
    if not own:
        return FleetEffectSection(section, Markup(""), 0)
    factor, unit = labels.scaled(own[0].unit)
    label = f"{labels.parameter(found.name, own[0].parameter)}{f' ({unit})' if unit else ''}"
    svg = sizes_figure(own, drawn, season, factor, label)
    return FleetEffectSection(section, Markup(svg), len(found.rovers) - len(drawn))  # noqa: S704  # texts are escaped


def _facts(found: FleetEffect, answer: FleetAnswer, labels: Labels, wheels: Sequence[int | str]) -> list[str]:
    of_these = [rover for rover in answer.rovers if rover.name in found.rovers]
    total = sum(len(rover.recordings) for rover in of_these)
    rovers = "all rovers" if len(of_these) == len(answer.rovers) else ", ".join(found.rovers)
    facts = [
        rovers if len(answer.rovers) > 1 else "",
        labels.wheels(found.wheels, wheels),
        f"in {len(found.recordings)} of {total} recordings" if total > 1 else "",
        _since(found),
        f"until {_day(found.until)}" if found.until else "",
        "constant" if found.covariate == "none" else f"depends on {labels.the(found.covariate)}",
    ]
    return [sections.unbroken(each) for each in facts if each]


def _since(found: FleetEffect) -> str:
    if found.since_low == found.since_high:
        return f"since {_day(found.since)}" if found.since else ""
    return f"since {_day(found.since)} (90 % sure: {_day(found.since_low)} to {_day(found.since_high)})"


def _day(date: str | None) -> str:
    return to_the_minute(date) if date else "–"


def unexplained(answer: FleetAnswer, labels: Labels, wheels: Sequence[int | str]) -> tuple[UnexplainedRow, ...]:
    """Return what no candidate explains, recording by recording."""
    return tuple(
        UnexplainedRow(
            rover=", ".join(place.rovers),
            recording=place.recordings[0] if len(place.recordings) == 1 else f"{len(place.recordings)} recordings",
            covariate=labels.covariate(place.covariate) + (f", only {place.range.statement}" if place.range else ""),
            where=labels.wheels(place.wheels, wheels),
            when=f"{number(place.from_s)} to {number(place.to_s)} s",
            share=percent(place.share_of_residual),
        )
        for place in answer.unexplained
    )


def curves(answer: FleetAnswer, labels: Labels) -> tuple[CurveSection, ...]:
    """Return the curves that recordings have in common."""
    return tuple(
        CurveSection(
            capital(f"{labels.covariate(place.covariate)}: {place.told_where}"),
            Markup(band_figure(place.covariate, place.curve, None, labels)),  # noqa: S704  # escaped inside
        )
        for place in answer.unexplained
        if place.curve is not None
    )


def parameters(answer: FleetAnswer) -> tuple[ParameterOfRover, ...]:
    """Return the simulation's parameters, and of which rovers they are."""
    every = {rover.name for rover in answer.rovers}
    return tuple(
        ParameterOfRover("all" if every == set(one.rovers) != {ONLY_ROVER} else ", ".join(one.rovers), row)
        for one, row in zip(answer.parameters, tables.calibrated(answer), strict=True)
    )


def sensitivity(answer: FleetAnswer, labels: Labels) -> tuple[sections.SensitivityRow, ...]:
    """Return the smallest detectable effect of each candidate that was not found; its share is not told."""
    found = {each.name for each in answer.effects}
    rows = []
    for one in answer.sensitivity:
        if one.name not in found and np.isfinite(one.smallest_detectable):
            factor, unit = labels.scaled(one.unit)
            size = f"{number(factor * one.smallest_detectable, 2)} {unit}".strip()
            rows.append(sections.SensitivityRow(capital(labels.effect(one.name)), size, ""))
    return tuple({row.label: row for row in rows}.values())


def recordings(rows: Sequence[CatalogueRow]) -> tuple[RecordingRow, ...]:
    """Return each recording once, rover by rover."""
    found = {
        row.recording: RecordingRow(
            row.rover, row.recording, f"{row.begins:%Y-%m-%d %H:%M}" if row.begins else "", row.verdict
        )
        for row in rows
    }
    return tuple(sorted(found.values(), key=lambda row: (row.rover, row.begins, row.name)))
