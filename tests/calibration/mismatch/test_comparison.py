"""The steps of a comparison, and what it hands back, on the linear machine."""

from __future__ import annotations

from html import unescape
from typing import TYPE_CHECKING

import pytest
from linear_machine import Level, table

from regolithd.calibration.mismatch import compare, from_columns
from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.result import Comparison

STEPS = [
    "simulating",
    "computing the columns of all candidates",
    "searching",
    "measuring on held-out blocks and comparing with rivals",
]


@pytest.fixture(scope="module")
def told() -> list[str]:
    """What the comparison says that it does."""
    return []


@pytest.fixture(scope="module")
def comparison(told: list[str]) -> Comparison:
    """Return a comparison that names a drag."""
    return compare(from_columns(table(drag=0.3), unit="axis"), Level(), progress=told.append)


@pytest.mark.usefixtures("comparison")
def test_a_linear_simulation_is_searched_once(told: list[str]) -> None:
    """Its tangents hold wherever the effects move the parameters, so that no second search is due."""
    assert told == STEPS


def test_json_and_report_are_those_of_the_answer(comparison: Comparison) -> None:
    """A notebook shows the report in a frame; quotes inside it are escaped."""
    assert comparison.to_json() == comparison.answer.to_json()
    shown = comparison._repr_html_()
    assert shown.startswith('<iframe srcdoc="')
    page, _, frame = shown.removeprefix('<iframe srcdoc="').partition('"')
    assert "height: 720px" in frame
    assert "<html" in unescape(page)
    assert "a recording in memory" in page


def test_the_evidence_says_what_the_report_labels(comparison: Comparison) -> None:
    """The column of wheels, the candidates that were looked for, and the terms without a channel."""
    evidence = comparison.evidence
    assert evidence.wheel_column == "axis"
    assert [candidate.name for candidate in evidence.candidates] == ["offset", "drag", "power", "step"]
    assert [(term.name, term.channel) for term in evidence.contributions] == [("drag", "")]


def test_a_corrected_file_needs_a_sim_toml(comparison: Comparison, tmp_path: Path) -> None:
    """A class in memory has none."""
    with pytest.raises(SimulationError, match="load the simulation from one, by load_simulation"):
        comparison.write_corrected(tmp_path / "corrected.toml")
    assert not list(tmp_path.iterdir())
