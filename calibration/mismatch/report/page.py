"""The report as one HTML file that opens without a network.

It shows an `Answer` and its `Evidence` and adds nothing to them. Scripts, fonts and pictures are not fetched; drawings
are inline SVG that follows the page's colours, light, dark and on paper. The same answer gives the same bytes.
`sections.py` prepares what `report.html` (Jinja2, with autoescape) lays out.
"""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from importlib import metadata, resources
from typing import TYPE_CHECKING

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup, escape

from regolithd.calibration.mismatch.report import sections, tables
from regolithd.calibration.mismatch.report.axes import number
from regolithd.calibration.mismatch.report.channel import channel_parts
from regolithd.calibration.mismatch.report.labels import Labels, verdict_sentence

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer, Evidence

COMPARED = ("numpy", "scipy", "pyarrow")
"""Packages that the result is computed with; the report lists their versions."""


@dataclass(frozen=True)
class Provenance:
    """Where the answer came from: names and SHA-256 of the two files, and the command that was given."""

    recording: str
    simulation: str
    recording_sha256: str
    simulation_sha256: str
    command: str = ""


def write_report(path: Path, answer: Answer, evidence: Evidence, provenance: Provenance) -> None:
    """Write the report."""
    path.write_text(render_report(answer, evidence, provenance), encoding="utf-8")


def render_report(answer: Answer, evidence: Evidence, provenance: Provenance) -> str:
    """Return the report as one HTML document."""
    labels = Labels.of(evidence)
    return (
        _environment()
        .get_template("report.html")
        .render(
            answer=answer,
            evidence=evidence,
            provenance=provenance,
            labels=labels,
            style=Markup(_resource("style.css")),  # noqa: S704  # our own file
            verdict=verdict_sentence(answer, labels),
            certainty=sections.certainty(answer, labels),
            summary=sections.summary(evidence, labels),
            parts=channel_parts(answer, evidence),
            confusions=sections.confusions(answer, labels),
            calibrated=tables.calibrated(answer),
            changes=tables.changes(answer, labels, evidence.wheels),
            left_out=tables.left_out(answer),
            channels=tables.channels(answer, {each.channel: each.unit for each in (evidence, *evidence.others)}),
            versions=_versions(),
        )
    )


def _environment() -> Environment:
    made = Environment(
        loader=FunctionLoader(_resource),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters |= {"number": number, "equation": equation}
    return made


def _resource(name: str) -> str:
    return resources.files("regolithd.calibration.mismatch.report").joinpath(name).read_text("utf-8")


def equation(text: str) -> Markup:
    """Return an equation with `x_y` and `x^y` as subscript and superscript."""
    lowered = re.sub(r"_(\w+)", r"<sub>\1</sub>", str(escape(text)))
    return Markup(re.sub(r"\^(\w+)", r"<sup>\1</sup>", lowered))  # noqa: S704  # escaped above


def _versions() -> list[str]:
    """Return the versions of Python, of this project and of the packages that it computes with."""
    found = [f"Python {platform.python_version()}"]
    for package in ("regolithd", *COMPARED):
        try:
            found.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            found.append(f"{package} from source")
    return found
