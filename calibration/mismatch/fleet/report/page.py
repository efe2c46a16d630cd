"""The report of many recordings as one HTML file that opens without a network.

It shows a fleet's answer and its catalogue, and adds nothing to them. `sections.py` and `figures.py` prepare what
`report.html` (Jinja2, with autoescape) lays out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from markupsafe import Markup

from regolithd.calibration.mismatch.fleet.report import sections
from regolithd.calibration.mismatch.fleet.report.figures import season_figure
from regolithd.calibration.mismatch.fleet.report.lanes import lanes_of
from regolithd.calibration.mismatch.fleet.report.season import Season
from regolithd.calibration.mismatch.inference.statements import plural
from regolithd.calibration.mismatch.report import sections as of_one
from regolithd.calibration.mismatch.report import tables
from regolithd.calibration.mismatch.report.figures import fit_figure
from regolithd.calibration.mismatch.report.labels import verdict_sentence
from regolithd.calibration.mismatch.report.template import render

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.fleet.evidence import FleetEvidence
    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer

MOST_ROVERS = 40
"""Rovers in the drawing of the season (a choice: two pages); where there are more, those with the most findings."""


@dataclass(frozen=True)
class FleetProvenance:
    """Where the answer came from: SHA-256 of each file by its name, of the simulation's, and the command."""

    recordings: Mapping[str, str] = field(default_factory=dict)
    simulation: str = "a simulation in memory"
    simulation_sha256: str = ""
    command: str = ""


IN_MEMORY = FleetProvenance()


def fleet_report(answer: FleetAnswer, evidence: FleetEvidence, provenance: FleetProvenance = IN_MEMORY) -> str:
    """Return the report as one HTML document."""
    labels, wheels = evidence.labels, evidence.wheels
    season, lanes = Season.of(evidence.rows), lanes_of(answer, labels, wheels, MOST_ROVERS)
    channels = tables.channels(answer, dict(evidence.units))
    unit = evidence.units.get(answer.fit.channel, "")
    return render(
        "fleet/report/report.html",
        answer=answer,
        provenance=provenance,
        verdict=verdict_sentence(answer, labels),
        wheels=plural(labels.wheel),
        summary=sections.summary(answer, labels, wheels),
        certainty=of_one.certainty(answer, labels),
        period=sections.period(answer),
        season=Markup(season_figure(lanes, season)),  # noqa: S704  # texts are escaped
        not_drawn=len(answer.rovers) - len({lane.rover for lane in lanes}),
        effects=sections.effects(answer, evidence.rows, season, labels, wheels),
        effects_not_shown=max(len(answer.effects) - sections.MOST_EFFECTS, 0),
        unexplained=sections.unexplained(answer, labels, wheels),
        curves=sections.curves(answer, labels),
        channels=channels,
        fit=Markup("" if channels else fit_figure(answer, unit, labels)),  # noqa: S704  # texts are escaped
        confusions=of_one.confusions(answer, labels),
        parameters=sections.parameters(answer),
        sensitivity=sections.sensitivity(answer, labels),
        undetectable=of_one.undetectable(answer, labels),
        left_out=tables.left_out(answer),
        recordings=sections.recordings(evidence.rows),
    )
