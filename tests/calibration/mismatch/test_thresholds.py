"""Thresholds are data: each has a value, a meaning and a source, and the engine reads them from the problem."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from golden import assert_golden
from linear_machine import Level, table

from regolithd.calibration.mismatch import compare, from_columns
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

ENGINE = Path(__file__).resolve().parents[3] / "calibration" / "mismatch"


def test_each_threshold_says_what_it_decides_and_how_it_was_found() -> None:
    """In words, with the value in use."""
    rows = THRESHOLDS.table()
    assert len(rows) > 60
    for row in rows:
        assert len(row.meaning) > 15, row.name
        assert row.meaning.endswith("."), row.name
        assert len(row.found) > 5, row.name
        assert row.value == getattr(THRESHOLDS, row.name)


def test_a_changed_threshold_is_seen_in_review() -> None:
    """Every value as it was when the blind trials were scored: after a change, repeat them (`make thresholds`)."""
    values = "".join(f"{row.name} {row.value:.9g}\n" for row in THRESHOLDS.table())
    assert_golden(values, Path(__file__).with_name("golden") / "thresholds.txt")


def test_the_table_shows_changed_values() -> None:
    """Of thresholds that were replaced."""
    changed = replace(THRESHOLDS, further_share=0.5)
    assert {row.name: row.value for row in changed.table()}["further_share"] == 0.5
    assert Thresholds() == THRESHOLDS


@pytest.mark.parametrize("name", [row.name for row in THRESHOLDS.table()])
def test_each_threshold_is_read_somewhere_in_the_engine(name: str) -> None:
    """No number stands in the table without deciding anything."""
    sources = [path.read_text() for path in ENGINE.rglob("*.py") if path.parent.name != "thresholds"]
    assert any(re.search(rf"\.{name}\b", source) for source in sources)


def test_a_comparison_decides_by_the_thresholds_that_it_is_given() -> None:
    """A drag of a seventh of the mean reading is named, unless only effects of a half are worth a name."""
    recording = from_columns(table(drag=0.3), unit="axis")
    assert [effect.name for effect in compare(recording, Level()).answer.effects] == ["drag"]
    strict = replace(THRESHOLDS, smallest_effect=0.5)
    assert compare(recording, Level(), thresholds=strict).answer.effects == ()
