"""The report as one HTML file that opens without a network.

It shows an `Answer` and its `Evidence` and adds nothing to them. Scripts, fonts and pictures are not fetched; drawings
are inline SVG that follows the page's colours, light, dark and on paper. The same answer gives the same bytes.
`sections.py` prepares what `report.html` (Jinja2, with autoescape) lays out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report import sections, tables
from regolithd.calibration.mismatch.report.channel import channel_parts
from regolithd.calibration.mismatch.report.labels import Labels, verdict_sentence
from regolithd.calibration.mismatch.report.template import render

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer, Evidence
    from regolithd.calibration.mismatch.report.template import Provenance


def write_report(path: Path, answer: Answer, evidence: Evidence, provenance: Provenance) -> None:
    """Write the report."""
    path.write_text(render_report(answer, evidence, provenance), encoding="utf-8")


def render_report(answer: Answer, evidence: Evidence, provenance: Provenance) -> str:
    """Return the report as one HTML document."""
    labels = Labels.of(evidence)
    return render(
        "report/report.html",
        answer=answer,
        evidence=evidence,
        provenance=provenance,
        labels=labels,
        verdict=verdict_sentence(answer, labels),
        certainty=sections.certainty(answer, labels),
        summary=sections.summary(evidence, labels),
        parts=channel_parts(answer, evidence),
        confusions=sections.confusions(answer, labels),
        calibrated=tables.calibrated(answer),
        changes=tables.changes(answer, labels, evidence.wheels),
        left_out=tables.left_out(answer),
        channels=tables.channels(answer, {each.channel: each.unit for each in (evidence, *evidence.others)}),
    )
