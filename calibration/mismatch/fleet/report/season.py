"""The horizontal axis of a fleet's drawings: when recordings began, or their order where that is not known."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report.axes import Panel, line, text, ticks

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow

STEPS = tuple(timedelta(hours=hours) for hours in (1, 3, 6, 12, 24, 48, 96, 168, 336))
"""Steps between marks, up to two weeks; longer seasons are marked at the first day of months."""
MONTHS = (1, 2, 3, 6, 12, 24, 60, 120)
"""Steps in months."""
MOST_MARKS = 5
"""Marks on an axis (a choice: a date is 75 px wide, and between two there is to be as much as a half of that)."""
MARGIN = 0.02
"""Share of the season that is left free at either end."""


@dataclass(frozen=True)
class Season:
    """Where each recording is on the axis.

    Attributes
    ----------
    places: by the recording's name: seconds since the first began, or its number
    rovers: whose each recording is, by its name
    first: when the first began; None: not known of all
    """

    places: Mapping[str, float]
    rovers: Mapping[str, str]
    first: datetime | None

    @classmethod
    def of(cls, rows: Sequence[CatalogueRow]) -> Season:
        """Return the axis of all recordings of a catalogue."""
        begins = {row.recording: row.begins for row in rows}
        rovers = {row.recording: row.rover for row in rows}
        dates = [each for each in begins.values() if each is not None]
        if len(dates) < len(begins):
            return cls({name: float(number) for number, name in enumerate(begins, 1)}, rovers, None)
        first = min(dates)
        return cls({name: (when - first).total_seconds() for name, when in begins.items() if when}, rovers, first)

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends of the axis."""
        low, high = min(self.places.values()), max(self.places.values())
        margin = MARGIN * (high - low) or 1.0
        return low - margin, high + margin

    def at(self, date: str | None) -> float | None:
        """Return where a date of the answer (ISO 8601) is; None: it has none."""
        if date is None or self.first is None:
            return None
        return (datetime.fromisoformat(date) - self.first).total_seconds()

    def axis(self, panel: Panel) -> str:
        """Return marks and labels below a panel."""
        bottom, parts = panel.top + panel.height, []
        for value, words in self._marks():
            x = panel.at_x(value)
            parts += [line([(x, bottom), (x, bottom + 4)], "axis"), text(x, bottom + 17, words, anchor="middle")]
        if self.first is None:
            parts.append(text(panel.left + panel.width / 2, bottom + 35, "recording, in their order", anchor="middle"))
        return "".join(parts)

    def _marks(self) -> Iterator[tuple[float, str]]:
        if self.first is None:
            for value in ticks(1.0, max(self.places.values()), MOST_MARKS):
                if value == int(value):
                    yield value, str(int(value))
            return
        last = self.first + timedelta(seconds=max(self.places.values()))
        for date, words in marks(self.first, last):
            yield (date - self.first).total_seconds(), words


def marks(first: datetime, last: datetime) -> list[tuple[datetime, str]]:
    """Return round dates from the first to the last, at most `MOST_MARKS`, and how each is written."""
    step = next((each for each in STEPS if (last - first) / each <= MOST_MARKS), None)
    if step is None:
        return _months(first, last)
    form = "%Y-%m-%d" if step >= timedelta(days=1) else "%m-%d %H:%M"
    midnight = first.replace(hour=0, minute=0, second=0, microsecond=0)
    number = -(-(first - midnight) // step)
    found = []
    while (date := midnight + number * step) <= last:
        found.append((date, f"{date:{form}}"))
        number += 1
    return found[:MOST_MARKS] or [(first, f"{first:%Y-%m-%d}")]


def _months(first: datetime, last: datetime) -> list[tuple[datetime, str]]:
    """Return first days of months."""
    begin, end = 12 * first.year + first.month, 12 * last.year + last.month - 1
    step = next((each for each in MONTHS if (end - begin) / each < MOST_MARKS), MONTHS[-1])
    start = first.replace(day=1, hour=0, minute=0, second=0, microsecond=0)
    numbers = range(-(-begin // step) * step, end + 1, step)
    dates = (start.replace(year=number // 12, month=number % 12 + 1) for number in numbers)
    return [(date, f"{date:%Y-%m}") for date in dates]
