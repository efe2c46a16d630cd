"""The decisions: one form, and an index that is complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DECISIONS = Path(__file__).resolve().parents[2] / "docs/decisions"
PAGES = sorted(path for path in DECISIONS.glob("[0-9]*.md") if not path.name.startswith("000"))
HEAD = re.compile(
    r"# (?P<number>\d{3}) (?P<title>[^\n]+)\n\n"
    r"\*(?P<status>Accepted|Proposed|Superseded by \d{3}), (?P<date>\d{4}-\d\d-\d\d)\.\*\n"
)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_decision_has_number_title_status_and_date(page: Path) -> None:
    """Each page begins as the template does, with the number of its file."""
    head = HEAD.match(page.read_text(encoding="utf-8"))
    assert head, "begin as docs/decisions/000-template.md does"
    assert page.name.startswith(f"{head['number']}-")


def test_the_index_has_every_decision() -> None:
    """The index lists each decision with its title, status and date, in the order of the numbers."""
    heads = [HEAD.match(page.read_text(encoding="utf-8")) for page in PAGES]
    rows = [
        f"| {head['number']} | [{head['title']}]({page.name}) | {head['status'].lower()} | {head['date']} |"
        for page, head in zip(PAGES, heads, strict=True)
        if head
    ]
    index = (DECISIONS / "README.md").read_text(encoding="utf-8")
    assert [line for line in index.splitlines() if re.match(r"\| \d", line)] == rows
