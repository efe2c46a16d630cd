"""The drawings of a fleet's report: what acts in which recording of which rover, and its size in each."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, svg, text
from regolithd.calibration.mismatch.report.figures import WIDTH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow
    from regolithd.calibration.mismatch.fleet.report.lanes import Lane
    from regolithd.calibration.mismatch.fleet.report.season import Season

LANE_PX, GAP_PX, LABELS_PX = 19.0, 7.0, 270.0
"""Height of a lane, space between rovers, and width of the labels on the left [px]."""
RADIUS_PX = 4.0
SIZE_PX = 92.0
"""Height of a rover's panel of sizes [px]."""
LONGEST_NAME, LONGEST_LABEL = 15, 32
"""Characters of a rover's name and of a lane's label that there is room for."""


def season_figure(lanes: Sequence[Lane], season: Season) -> str:
    """Draw a lane for each effect of each rover, with a mark for each of its recordings."""
    parts: list[str] = []
    top, rover = 8.0, ""
    for lane in lanes:
        if lane.rover != rover:
            top += GAP_PX if rover else 0.0
            parts.append(text(0, top + LANE_PX / 2 + 4, _short(lane.rover, LONGEST_NAME), kind="strong"))
            rover = lane.rover
        panel = Panel(LABELS_PX, top, WIDTH - LABELS_PX - 12, LANE_PX - 1, season.ends, (0, 1))
        parts += [box(panel), *_lane(lane, panel, season)]
        parts.append(text(LABELS_PX - 9, top + LANE_PX / 2 + 4, _short(lane.label, LONGEST_LABEL), anchor="end"))
        top += LANE_PX
    below = Panel(LABELS_PX, top, WIDTH - LABELS_PX - 12, 0.0, season.ends, (0, 1))
    parts.append(season.axis(below))
    return svg(WIDTH, top + (26 if season.first else 44), parts, "What acts in which recording of which rover")


def _lane(lane: Lane, panel: Panel, season: Season) -> list[str]:
    """Return the interval in which the effect began, its line, and a mark for each recording."""
    parts = []
    low, at, high = (season.at(date) for date in (lane.since_low, lane.since, lane.since_high))
    if low is not None and high is not None:
        x0, x1 = panel.at_x(low), panel.at_x(high)
        parts.append(box(replace(panel, left=x0, width=max(x1 - x0, 1.0)), "noise"))
    for edge in (at, season.at(lane.until)):
        if edge is not None:
            x = panel.at_x(edge)
            parts.append(line([(x, panel.top), (x, panel.top + panel.height)], "onset"))
    down = panel.top + panel.height / 2
    for recording, kind in lane.marks.items():
        x = panel.at_x(season.places[recording])
        parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{down:.1f}" r="{RADIUS_PX}"/>')
    return parts


def sizes_figure(rows: Sequence[CatalogueRow], rovers: Sequence[str], season: Season, factor: float, label: str) -> str:
    """Draw an effect's size in each recording alone, with its 90 % interval, a panel for each rover.

    `factor` is from the rows' unit to that of the `label`.
    """
    ends = [factor * each for row in rows for each in (row.low, row.high) if each is not None]
    low, high = min([0.0, *ends]), max([0.0, *ends])
    margin = 0.08 * ((high - low) or 1.0)
    parts: list[str] = []
    panel = Panel(84, 0, WIDTH - 96, 0, season.ends, (0, 1))
    for place, rover in enumerate(rovers):
        panel = Panel(84, 22 + place * (SIZE_PX + 26), WIDTH - 96, SIZE_PX, season.ends, (low - margin, high + margin))
        zero = panel.at_y(0.0)
        parts += [text(84, panel.top - 7, rover, kind="strong"), box(panel)]
        if place == 0:
            parts.append(text(panel.left + panel.width, panel.top - 7, label, anchor="end"))
        parts.append(line([(panel.left, zero), (panel.left + panel.width, zero)], "zero"))
        points = {(row.recording, row.value): row for row in rows if row.rover == rover and row.value is not None}
        for row in points.values():
            parts += _size(row, panel, season, factor)
        parts.append(axes(panel, "", "", x_about=0, y_about=3))
    parts.append(season.axis(panel))
    return svg(WIDTH, panel.top + SIZE_PX + (26 if season.first else 44), parts, f"{label} in each recording")


def _size(row: CatalogueRow, panel: Panel, season: Season, factor: float) -> list[str]:
    x, kind = panel.at_x(season.places[row.recording]), "before" if row.acts else "absent"
    low, at, high = (panel.at_y(factor * (each or 0.0)) for each in (row.low, row.value, row.high))
    return [
        line([(x, low), (x, high)], f"{kind} bar"),
        f'<circle class="{kind}" cx="{x:.1f}" cy="{at:.1f}" r="{RADIUS_PX - 0.6}"/>',
    ]


def _short(words: str, longest: int) -> str:
    """Return a label that is cut where there is no room for it."""
    return words if len(words) <= longest else words[: longest - 1] + "…"
