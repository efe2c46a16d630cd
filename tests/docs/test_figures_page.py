"""The page of figures is made of what was measured, and of nothing else."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import figures_page
import pytest

if TYPE_CHECKING:
    from pathlib import Path


def test_lines_and_cells_become_tables() -> None:
    """A key `ROW / COLUMN` is a cell of a table with a line for each row, any other key a line of the list."""
    figures = {
        "command": "make bench",
        "measured": "two cores",
        "frames_per_s": 28460,
        "import / ours": 0.31234,
        "import / theirs": None,
        "idle / ours": 0.5,
    }
    text = figures_page.page("", {"bench": figures})
    assert "`make bench`: two cores." in text
    assert "| frames_per_s | 28460 |" in text
    assert "|  | ours | theirs |\n| --- | --- | --- |\n| import | 0.3123 | – |\n| idle | 0.5 |  |" in text


def test_sections_without_new_figures_stay() -> None:
    """Writing the page with the figures of one measurement leaves the sections of the others as they were."""
    first = figures_page.page("", {"bench": {"frames": 1}, "fuzz": {"inputs": 2}})
    second = figures_page.page(first, {"bench": {"frames": 3}})
    assert second == first.replace("| frames | 1 |", "| frames | 3 |")
    assert figures_page.page(second, {}) == second


def test_nested_figures_are_refused_with_one_message(tmp_path: Path) -> None:
    """A file of figures that is not flat ends in one message that names it."""
    (tmp_path / "bench.json").write_text(json.dumps({"frames": {"ours": 1}}))
    with pytest.raises(SystemExit, match=r"bench\.json: not one flat JSON object"):
        figures_page.read_figures(tmp_path)


def test_the_page_is_what_the_command_writes() -> None:
    """The tracked page is unchanged when it is written again without new figures."""
    text = figures_page.PAGE.read_text(encoding="utf-8")
    assert figures_page.page(text, {}) == text
