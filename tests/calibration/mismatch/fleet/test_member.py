"""Dates in the names of files."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from regolithd.calibration.mismatch.fleet.member import date_in


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("2026-05-03.csv", datetime(2026, 5, 3, tzinfo=UTC)),
        ("rover-20260503T081500Z.mcap", datetime(2026, 5, 3, 8, 15, tzinfo=UTC)),
        ("drive_2026-05-03_08-15-30_b.parquet", datetime(2026, 5, 3, 8, 15, 30, tzinfo=UTC)),
        ("traverse 7.csv", None),
        ("20261399.csv", None),
        ("serial-120260503999.csv", None),
    ],
)
def test_a_date_in_a_name_is_read(name: str, told: datetime | None) -> None:
    """With or without the time of day; what is no date is none."""
    assert date_in(name) == told
