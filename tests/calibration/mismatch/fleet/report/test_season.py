"""The axis of a fleet's drawings: round dates, or the order of recordings."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow
from regolithd.calibration.mismatch.fleet.report.season import MOST_MARKS, Season, marks
from regolithd.calibration.mismatch.report.axes import Panel

FIRST = datetime(2026, 3, 1, 8, 0, tzinfo=UTC)


@pytest.mark.parametrize(
    ("length", "first", "second"),
    [
        (timedelta(hours=5), "03-01 08:00", "03-01 09:00"),
        (timedelta(days=2), "03-01 12:00", "03-02 00:00"),
        (timedelta(days=6), "2026-03-03", "2026-03-05"),
        (timedelta(days=60), "2026-03-15", "2026-03-29"),
        (timedelta(days=200), "2026-05", "2026-07"),
        (timedelta(days=700), "2026-07", "2027-01"),
        (timedelta(days=3650), "2028-01", "2030-01"),
    ],
)
def test_dates_are_round(length: timedelta, first: str, second: str) -> None:
    """At hours, days, weeks or months; at most as many as there is room for, none outside of the season."""
    found = marks(FIRST, FIRST + length)
    assert [words for _, words in found[:2]] == [first, second]
    assert 2 <= len(found) <= MOST_MARKS
    assert all(FIRST <= date <= FIRST + length for date, _ in found)


def test_a_season_of_one_instant_has_one_mark() -> None:
    """And ends that are apart."""
    season = Season.of([CatalogueRow("asper", "a.csv", FIRST, "consistent")])
    assert season.ends == (-1.0, 1.0)
    assert "03-01" in season.axis(Panel(0, 0, 100, 10, season.ends, (0, 1)))


def test_recordings_without_dates_are_in_their_order() -> None:
    """Where one lacks its date, no date of the answer has a place."""
    rows = [
        CatalogueRow("asper", "a.csv", FIRST, "consistent"),
        CatalogueRow("asper", "b.csv", None, "consistent"),
        CatalogueRow("bruno", "c.csv", FIRST, "consistent"),
    ]
    season = Season.of(rows)
    assert season.places == {"a.csv": 1.0, "b.csv": 2.0, "c.csv": 3.0}
    assert season.at("2026-03-01T08:00:00Z") is None
    assert "in their order" in season.axis(Panel(0, 0, 100, 10, season.ends, (0, 1)))


def test_a_date_of_the_answer_is_where_its_recording_is() -> None:
    """In seconds from the first recording."""
    rows = [CatalogueRow("asper", f"{day}", FIRST + timedelta(days=day), "consistent") for day in (3, 0)]
    season = Season.of(rows)
    assert season.at("2026-03-04T08:00:00Z") == season.places["3"] == 3 * 86400
    assert season.at(None) is None
