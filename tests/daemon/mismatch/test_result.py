"""What the `mismatch` message says of an answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from sample_answer import ANSWER, CONSISTENT, WORN

from regolithd.calibration.mismatch.answer import Change
from regolithd.daemon.mismatch.result import comparison_result

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.daemon.messages.mismatch import ComparisonResult

CHANGED = Change(
    "viscous-friction",
    "size",
    corrected=0.5,
    now=0.25,
    low=0.2,
    high=0.3,
    unit="A s/rad",
    channel="motor_current_A",
    wheels=(2, 4),
    statement="viscous-friction is smaller than the corrected simulation has it.",
)
FILES: Any = SimpleNamespace(recording=Path("a/drive.mcap"), report=Path("a/report.html"))


def result_of(answer: Answer) -> ComparisonResult:
    """Return the message's content."""
    return comparison_result(answer, FILES, Path("rover/SIM.toml"))


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (CONSISTENT, "The simulation agrees with the traverse."),
        (replace(ANSWER, unexplained=()), "The simulation leaves out: bearing-drag, viscous-friction."),
        (replace(ANSWER, effects=(WORN, WORN), unexplained=()), "The simulation leaves out: bearing-drag."),
        (replace(ANSWER, effects=()), "A part of the difference has no name."),
        (
            replace(CONSISTENT, changes=(CHANGED,)),
            "Changed since the simulation was corrected: viscous-friction.",
        ),
    ],
)
def test_the_text_says_what_was_found(answer: Answer, text: str) -> None:
    """One sentence for each kind of finding, each name once."""
    assert result_of(answer).text == text


def test_an_effect_has_its_size_and_its_wheels() -> None:
    """The size is its first parameter; six wheels are all."""
    worn, viscous = result_of(ANSWER).effects
    assert (worn.where, viscous.where) == ("wheel 4", "all wheels")
    assert (worn.size, worn.low, worn.high, worn.unit) == (0.0077, 0.0071, 0.0083, "A")
    two = replace(CONSISTENT, effects=(replace(WORN, wheels=(1, 3)),))
    assert result_of(two).effects[0].where == "wheels 1, 3"


def test_a_change_is_told_with_what_it_was() -> None:
    """And the files by their names; the report by its path."""
    told = result_of(replace(CONSISTENT, changes=(CHANGED,)))
    (change,) = told.changes
    assert change.statement == CHANGED.statement
    assert (change.size, change.low, change.high, change.unit) == (0.25, 0.2, 0.3, "A s/rad")
    assert change.where == "wheels 2, 4"
    assert (told.recording, told.simulation, told.report) == ("drive.mcap", "SIM.toml", "a/report.html")
