"""The report of many recordings: faithful to answer and catalogue, self-contained, and the same for the same answer."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import escape

import pytest

from regolithd.calibration.mismatch.answer import FitImprovement, Indistinguishable, Parameter, Sensitivity
from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow
from regolithd.calibration.mismatch.fleet.comparison import FleetComparison
from regolithd.calibration.mismatch.fleet.evidence import FleetEvidence
from regolithd.calibration.mismatch.fleet.report import page
from regolithd.calibration.mismatch.fleet.report.lanes import ABSENT, ACTS, UNEXPLAINED, lanes_of
from regolithd.calibration.mismatch.fleet.report.page import FleetProvenance, fleet_report
from regolithd.calibration.mismatch.fleet.report.sections import MOST_EFFECTS, MOST_PANELS
from regolithd.calibration.mismatch.fleet.told.answer import (
    FleetAnswer,
    FleetEffect,
    FleetParameter,
    FleetUnexplained,
    RoverOfFleet,
)
from regolithd.calibration.mismatch.problem.problem import LeftOut
from regolithd.calibration.mismatch.report.labels import Labels
from regolithd.calibration.mismatch.simulation.simulation import Simulation

FIRST = datetime(2026, 3, 1, 8, 0, tzinfo=UTC)
ROVERS = ("asper", "bruno <b>")
DAYS = 4


def name_of(rover: str, day: int) -> str:
    """Return a recording's name."""
    return f"{rover} {day}"


def date(day: int) -> str:
    """Return when a day's recordings began, as an answer tells it."""
    return (FIRST + timedelta(days=day)).isoformat().replace("+00:00", "Z")


DRAG = FleetEffect(
    name="bearing-drag",
    channel="torque_Nm",
    wheels=("wrist",),
    covariate="time",
    onset_s=None,
    equation="Δy = y_b g(t − t_0) sign(ω)",
    statement="drag on axis wrist of bruno <b> since the third day: 25 % of the mean reading.",
    parameters={"drag_current": Parameter(0.25, 0.2, 0.3, "N·m"), "relative_size": Parameter(0.25, 0.2, 0.3, "1")},
    rmse_before=0.2,
    rmse_after=0.1,
    rovers=(ROVERS[1],),
    recordings=tuple(name_of(ROVERS[1], day) for day in (2, 3)),
    since=date(2),
    since_low=date(1),
    since_high=date(2),
)
ANSWER = FleetAnswer(
    verdict="unexplained",
    effects=(DRAG,),
    unexplained=(
        FleetUnexplained(
            "torque_Nm", ("elbow",), "temperature", 3.0, 40.0, 0.3, rovers=("asper",), recordings=(name_of("asper", 1),)
        ),
    ),
    indistinguishable=(Indistinguishable(("bearing-drag", "coulomb-friction"), "Drive it warm.", beside=()),),
    sensitivity=(
        Sensitivity("viscous-friction", "torque_Nm", 0.0123, "N·m"),
        Sensitivity("sensor-delay", "torque_Nm", float("inf"), "N·m"),
    ),
    fit=FitImprovement("torque_Nm", 0.2, 0.1, 0.09),
    parameters=(
        FleetParameter("inertia_kg_m2", "kg·m²", 0.5, 0.02, 0.6, 0.59, 0.61, rovers=("asper",)),
        FleetParameter("inertia_kg_m2", "kg·m²", 0.5, 0.02, 0.51, 0.5, 0.52, rovers=(ROVERS[1],)),
    ),
    left_out=(LeftOut("torque_Nm", 1234, "blank"),),
    notes=("a note",),
    rovers=tuple(
        RoverOfFleet(rover, tuple(name_of(rover, day) for day in range(DAYS)), date(0), date(DAYS - 1))
        for rover in ROVERS
    ),
)


def row(rover: str, day: int, **content: object) -> CatalogueRow:
    """Return a row of the catalogue."""
    return CatalogueRow(rover, name_of(rover, day), FIRST + timedelta(days=day), "consistent", **content)  # type: ignore[arg-type]


ROWS = (
    *(row("asper", day) for day in range(DAYS)),
    *(
        row(
            ROVERS[1],
            day,
            wheel="wrist",
            effect="bearing-drag",
            covariate="time",
            channel="torque_Nm",
            found="fleet",
            acts=day >= 2,
            parameter="drag_current",
            value=0.1 * day,
            low=0.1 * day - 0.02,
            high=0.1 * day + 0.02,
            unit="N·m",
        )
        for day in range(DAYS)
    ),
)
EVIDENCE = FleetEvidence(
    ROWS, Labels("axis", {"temperature": "oil temperature (°C)"}), {"torque_Nm": "N·m"}, ("elbow", "wrist")
)


def shown(answer: FleetAnswer = ANSWER, rows: tuple[CatalogueRow, ...] = ROWS) -> str:
    """Return the page, with text on one line each."""
    return re.sub(r"\s+", " ", fleet_report(answer, replace(EVIDENCE, rows=rows)))


def marks(drawing: str) -> dict[str, int]:
    """Return how many circles of each class a drawing has."""
    return {kind: drawing.count(f'<circle class="{kind}"') for kind in (ACTS, ABSENT, UNEXPLAINED)}


def drawings(text: str) -> dict[str, str]:
    """Return the drawings by their label for screen readers."""
    found = re.findall(r'<svg [^>]*aria-label="([^"]*)".*?</svg>', text)
    return dict(zip(found, re.findall(r"<svg .*?</svg>", text), strict=True))


def test_everything_of_the_answer_is_on_the_page() -> None:
    """Effects, what is unexplained, rivals, parameters with those that left their prior, what was left out, notes."""
    text = shown()
    for words in (
        escape("Drag on axis wrist of bruno <b> since the third day: 25 % of the mean reading.", quote=False),
        "since 2026-03-03 08:00 (90 % sure: 2026-03-02 08:00 to 2026-03-03 08:00)",
        "in 2 of 4 recordings",
        "<td>oil temperature</td><td>axis elbow</td><td>3 to 40 s</td>",
        "Drive it warm.",
        "<b>left its prior</b>",
        "1,234",
        "<li>a note</li>",
        "0.012 N·m",
        "recorded <b>2026-03-01 to 2026-03-04</b>",
        "<b>2</b> rovers",
        "<b>8</b> recordings",
    ):
        assert words in text, words
    moved = "The parameter inertia_kg_m2 of asper had to leave its prior."
    assert moved in shown(replace(ANSWER, verdict="missing-physics", unexplained=()))


def test_nothing_is_fetched_and_names_are_escaped() -> None:
    """No script, link or address; a rover's name is text; twice the same bytes."""
    text = fleet_report(ANSWER, EVIDENCE)
    assert not re.search(r"<script|<link|<img|url\(|https?://(?!www\.w3\.org/2000/svg)", text)
    assert "bruno <b>" not in text
    assert text == fleet_report(ANSWER, EVIDENCE)


def test_the_season_has_a_mark_for_each_recording_of_each_lane() -> None:
    """Filled where an effect acts, grey where something is unexplained, empty elsewhere."""
    season = drawings(shown())["What acts in which recording of which rover"]
    assert marks(season) == {ACTS: 2, ABSENT: 5, UNEXPLAINED: 1}
    assert season.count('class="onset"') == 1
    assert season.count('class="noise"') == 1


def test_the_sizes_are_those_of_the_catalogue() -> None:
    """A point with its interval for each recording of the rover, filled where the effect acts."""
    sizes = drawings(shown())["drag (N·m) in each recording"]
    assert marks(sizes) == {ACTS: 2, ABSENT: 2, UNEXPLAINED: 0}
    heights = [float(y) for y in re.findall(r'<circle class="\w+" cx="[\d.]+" cy="([\d.]+)"', sizes)]
    assert heights == sorted(heights, reverse=True)
    assert heights[0] - heights[1] == pytest.approx(heights[2] - heights[3], abs=0.2)


def test_an_effect_with_an_end_and_one_of_a_single_recording_are_lanes_too() -> None:
    """What single recordings show alike on the same axes is one lane; a rover with nothing says so."""
    gone = replace(DRAG, since=None, since_low=None, since_high=None, until=date(2), wheels=("elbow", "wrist"))
    once = [replace(DRAG, name="viscous-friction", recordings=(name_of(ROVERS[1], day),), since=None) for day in (0, 3)]
    answer = replace(ANSWER, effects=(gone, *once), unexplained=())
    lanes = lanes_of(answer, Labels("axis"), ("elbow", "wrist"), 9)
    assert [lane.label for lane in lanes] == ["nothing found", "bearing drag", "viscous friction, axis wrist"]
    assert lanes[1].until == date(2)
    assert list(lanes[2].marks.values()) == [ACTS, ABSENT, ABSENT, ACTS]
    assert "until 2026-03-03 08:00" in shown(answer)


def test_of_a_large_fleet_what_is_not_shown_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rovers without a finding are left out first; sizes of six rovers and twenty effects are drawn."""
    monkeypatch.setattr(page, "MOST_ROVERS", 1)
    many = tuple(f"r{number}" for number in range(MOST_PANELS + 1))
    of_all = replace(DRAG, rovers=many, recordings=tuple(name_of(rover, 2) for rover in many))
    rows = tuple(replace(each, rover=rover, recording=name_of(rover, 2)) for each in ROWS[-1:] for rover in many)
    answer = replace(
        ANSWER,
        effects=(of_all, *[DRAG] * MOST_EFFECTS),
        rovers=tuple(RoverOfFleet(rover, (name_of(rover, 2),), None, None) for rover in many),
        unexplained=(),
    )
    text = shown(answer, rows)
    assert f"{MOST_PANELS} further rovers, with fewer findings, are not drawn." in text
    assert "1 further rovers are in the catalogue." in text
    assert "1 further effects are in the answer and in the catalogue." in text
    assert "recorded <b>" not in text


def test_sizes_that_no_recording_tells_alone_are_not_drawn() -> None:
    """Their panel is empty."""
    blank = tuple(replace(each, value=None, low=None, high=None) for each in ROWS)
    assert marks(drawings(shown(rows=blank))["drag (N·m) in each recording"]) == {ACTS: 0, ABSENT: 0, UNEXPLAINED: 0}


def test_a_consistent_fleet_has_a_season_and_what_it_is_worth() -> None:
    """And no section of effects; several channels have a table of their errors."""
    answer = replace(ANSWER, verdict="consistent", effects=(), unexplained=(), indistinguishable=(), parameters=())
    two = replace(answer, fits=(ANSWER.fit, replace(ANSWER.fit, channel="speed_rad_s")))
    text = shown(two, tuple(row(rover, day) for rover in ROVERS for day in range(DAYS)))
    assert "Simulation and recording agree to within the noise." in text
    assert "Effects that the simulation leaves out" not in text
    assert "Smallest detectable effects" in text
    assert "<td>speed_rad_s</td>" in text
    assert text.count("nothing found") == len(ROVERS)


def test_the_files_are_named_with_their_digests() -> None:
    """As the command line gives them."""
    text = fleet_report(ANSWER, EVIDENCE, FleetProvenance({"a.csv": "aa11"}, "SIM.toml", "bb22", "regolithd mismatch"))
    for words in ("<td>a.csv</td><td><code>aa11</code></td>", "sha256 bb22", "<code>regolithd mismatch</code>"):
        assert words in text


def test_a_notebook_shows_the_page() -> None:
    """In a frame of its own."""
    shown_there = FleetComparison(ANSWER, EVIDENCE, Simulation())._repr_html_()
    assert escape("<title>The simulation leaves out", quote=True) in shown_there
