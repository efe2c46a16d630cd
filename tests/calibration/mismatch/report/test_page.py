"""The whole report of one answer with everything in it, as it was reviewed."""

from __future__ import annotations

import re
from pathlib import Path

from golden import assert_golden
from sample_answer import ANSWER, CONSISTENT, FROM, evidence

from regolithd.calibration.mismatch.report.page import render_report

GOLDEN = Path(__file__).with_name("golden")


def one_tag_a_line(page: str) -> str:
    """Return a page without style sheet and versions, each tag on a line of its own, for a readable difference."""
    page = re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    page = re.sub(r"Python [\d.]+, regolithd [^<]*", "VERSIONS", page)
    return re.sub(r">\s*<", ">\n<", page) + "\n"


def test_the_report_of_an_answer_with_everything_in_it() -> None:
    """Header, maps, effects with curves and parameters, what is unexplained or indistinguishable, notes."""
    assert_golden(one_tag_a_line(render_report(ANSWER, evidence(1800.0), FROM)), GOLDEN / "missing-physics.html")


def test_the_report_of_a_consistent_answer() -> None:
    """No effects; a short recording has seconds on its axes."""
    assert_golden(one_tag_a_line(render_report(CONSISTENT, evidence(45.0), FROM)), GOLDEN / "consistent.html")
