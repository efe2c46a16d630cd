"""Pages of the documentation whose tables are made from the code."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.reference.answer_keys import answer_tables
from regolithd.calibration.mismatch.reference.effects import effect_sections

if TYPE_CHECKING:
    from collections.abc import Callable

MARK = "<!-- Below: written by `python -m regolithd.calibration.mismatch.reference`; a test holds it to the code. -->"
"""The line of a page after which its tables are."""
PAGES: dict[str, Callable[[], str]] = {"effects.md": effect_sections, "answer.md": answer_tables}
"""For each page, the function that returns its tables."""


def with_tables(name: str, page: str) -> str:
    """Return a page with its tables as the code has them now.

    Raises
    ------
    ValueError
        Where the page has no line `MARK`.
    """
    above, mark, _ = page.partition(MARK)
    if not mark:
        raise ValueError(f"{name} has no line {MARK}")
    return f"{above}{mark}\n\n{PAGES[name]()}"
