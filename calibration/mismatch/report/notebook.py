"""The report inside a notebook: the whole page in a frame, which keeps its style and the notebook's apart."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report.page import render_report
from regolithd.calibration.mismatch.report.template import Provenance

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer, Evidence

HEIGHT_PX = 720
"""Height of the frame; the page scrolls inside it."""
IN_MEMORY = Provenance("a recording in memory", "a simulation in memory", "", "")


def notebook_html(answer: Answer, evidence: Evidence) -> str:
    """Return the report as HTML for a notebook's cell (`_repr_html_`)."""
    return in_frame(render_report(answer, evidence, IN_MEMORY))


def in_frame(page: str) -> str:
    """Return a whole page as HTML for a notebook's cell."""
    style = f"width: 100%; height: {HEIGHT_PX}px; border: 0"
    return f'<iframe srcdoc="{escape(page, quote=True)}" style="{style}" title="report"></iframe>'
