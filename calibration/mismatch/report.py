"""The report: one self-contained HTML page that opens offline."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from calibration.mismatch.compare import Comparison


def write_report(path: Path, comparison: Comparison, title: str) -> None:
    """Write the answer as a page."""
    answer = comparison.answer
    told = "".join(f"<li><b>{escape(e.name)}</b>: {escape(e.statement)}</li>" for e in answer.effects)
    page = f"<!doctype html><meta charset=utf-8><title>{escape(title)}</title><h1>{answer.verdict}</h1><ul>{told}</ul>"
    path.write_text(page, encoding="utf-8")
