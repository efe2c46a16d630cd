"""The study of effects without a name: what counts as right, and what it prints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.validation.unnamed_effects.__main__ import Outcome, summary
from regolithd.calibration.validation.unnamed_effects.picture import draw
from regolithd.calibration.validation.unnamed_effects.recordings import Concealed

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("kind", "form", "equation", "right"),
    [
        ("slope-drag", "power", "Δmotor_current_A = (c pitch²) · sign(motion)", True),
        ("slope-drag", "power", "Δmotor_current_A = (c |pitch|^p) · sign(motion)", True),
        ("slope-drag", "power", "Δmotor_current_A = (c pitch) · sign(motion)", False),
        ("side-hill", "power", "Δmotor_current_A = (c roll) · sign(motion) · (opposite sides)", True),
        ("side-hill", "power", "Δmotor_current_A = (c |roll|) · sign(motion) · (opposite sides)", False),
        ("cable-spring", "power", "Δmotor_current_A = c position³", True),
        ("resonance", "bump", "", True),
        ("resonance", "step", "", False),
        ("rubbing-cable", "step", "", False),
    ],
)
def test_a_suggestion_is_right_by_family_and_exponent(kind: str, form: str, equation: str, *, right: bool) -> None:
    """A power of another exponent or symmetry is another law; what happens at some times has none."""
    concealed = Concealed("rover", kind, "", "", 1.0, None, None)  # type: ignore[arg-type]
    assert concealed.is_right(form, equation) is right


OUTCOMES = [
    Outcome("rover", "resonance", "wheel_speed", 1.2, 1.01, ("bump", "step"), 1),
    Outcome("rover", "slope-drag", "pitch", 1.3, 1.2, ("bump", "power"), 2),
    Outcome("rover", "voltage", "voltage", 1.3, 1.0, ("bump", "power"), 0),
    Outcome("rover", "rubbing-cable", "time", 1.1, 1.0, (), 0),
    Outcome("rover", "grease-peak", "", 0.0, 0.0, (), 0),
]


def test_the_summary_counts_recordings_in_which_something_was_found() -> None:
    """Forms are of those with a law over a covariate."""
    lines = summary(OUTCOMES)
    assert lines[0] == "recordings 5, with something unexplained 4"
    assert lines[1].endswith("median 1.005, largest 1.200; within 5 % in 3 of 4 (75%)")
    assert lines[3] == "right closed form among the first three: 2 of 3 (67%); first: 1 (33%)"


def test_the_picture_has_a_row_for_each_of_them(tmp_path: Path) -> None:
    """What was not found is not drawn."""
    draw(OUTCOMES, tmp_path / "study.svg")
    text = (tmp_path / "study.svg").read_text(encoding="utf-8")
    assert text.count("<!-- resonance (rover) -->") + text.count(">resonance (rover)<") == 1
    assert "grease-peak" not in text
