"""The tables of the documentation about effects and answer are those of the code."""

from __future__ import annotations

from pathlib import Path

import pytest

from regolithd.calibration.mismatch.answer import answer_schema
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.problem.words import in_words
from regolithd.calibration.mismatch.reference.pages import PAGES, with_tables

FOLDER = Path(__file__).resolve().parents[4] / "docs/reference"


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_what_the_code_says(name: str) -> None:
    """Each page equals the output of `python -m regolithd.calibration.mismatch.reference docs/reference`."""
    page = (FOLDER / name).read_text(encoding="utf-8")
    assert page == with_tables(name, page)


def test_every_effect_and_key_is_on_its_page() -> None:
    """The pages as they lie in the repository hold each effect and each key of the answer."""
    effects, answer = ((FOLDER / name).read_text(encoding="utf-8") for name in ("effects.md", "answer.md"))
    assert [each.name for each in library() if f"`{each.name}`: {in_words(each.words, {})}" not in effects] == []
    assert [key for key in answer_schema()["properties"] if f"| `{key}` |" not in answer] == []


def test_a_page_without_the_line_is_refused() -> None:
    """A page that has lost the line above its tables is not overwritten."""
    with pytest.raises(ValueError, match=r"effects\.md has no line"):
        with_tables("effects.md", "# Effects\n")
