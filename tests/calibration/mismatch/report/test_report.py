"""The report: self-contained, faithful to the answer, and the same for the same answer."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
import sample_answer
from sample_answer import FROM

from regolithd.calibration.mismatch.answer import (
    Answer,
    Curve,
    Evidence,
    FitImprovement,
    Indistinguishable,
    OtherAnswer,
    Parameter,
    Sensitivity,
    Unexplained,
)
from regolithd.calibration.mismatch.candidates.candidate import Candidate
from regolithd.calibration.mismatch.candidates.coulomb_friction import CoulombFriction
from regolithd.calibration.mismatch.inference.statements import plural, statement
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve
from regolithd.calibration.mismatch.report.axes import number, ticks
from regolithd.calibration.mismatch.report.curves import curve_of
from regolithd.calibration.mismatch.report.labels import Labels, verdict_sentence
from regolithd.calibration.mismatch.report.notebook import notebook_html
from regolithd.calibration.mismatch.report.page import render_report
from regolithd.calibration.mismatch.report.sections import certainty
from regolithd.calibration.mismatch.report.template import equation

WORN = replace(
    sample_answer.WORN,
    statement="drag on wheel 4 <from> 612 s on",
    parameters={"drag_current": Parameter(0.0077, 0.0071, 0.0083, "A")},
)
VOID = {"img", "meta", "link", "br", "path", "rect", "circle"}


class Balanced(HTMLParser):
    """Collects tags that were opened and not closed, and everything that the page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Remember what is opened and what would be fetched."""
        self.fetched += [value or "" for name, value in attrs if name in {"src", "href"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Ignore: it is closed."""

    def handle_endtag(self, tag: str) -> None:
        """Close what was opened last, or fail."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Keep what people read."""
        self.text.append(data)


@pytest.fixture
def evidence() -> Evidence:
    """Half an hour of six wheels, with a map and two curves."""
    rng = np.random.default_rng(0)
    residual = rng.normal(size=(900, 6))
    residual[0, 0] = np.nan
    grid = np.linspace(0, 1800, 12)
    curve = Curve("time", "drag", grid, grid * 1e-5, grid * 0, grid * 0 + 2e-4, (4,))
    blocks = np.arange(30) * 60 + 30.0
    stood_out = rng.normal(size=(30, 6))
    stood_out[3, 2] = np.nan
    return Evidence(
        channel="motor_current_A",
        unit="A",
        time_s=np.arange(900) * 2.0,
        wheels=(1, 2, 3, 4, 5, 6),
        measured=residual,
        before=residual,
        after=residual,
        map_time_s=blocks,
        map_before=stood_out,
        map_after=stood_out,
        curves=(curve, replace(curve, covariate="temperature")),
        values={},
        contributions=(),
    )


def answer(**said: object) -> Answer:
    """Return a consistent answer, changed as told."""
    fit = FitImprovement("motor_current_A", 0.0061, 0.0049, 0.0048)
    plain = Answer(
        "consistent", (), (), (), (Sensitivity("coulomb-friction", "motor_current_A", float("inf"), "A"),), fit
    )
    return replace(plain, **said)  # type: ignore[arg-type]


ANSWERS = {
    "consistent": answer(),
    "missing-physics": answer(verdict="missing-physics", effects=(WORN,)),
    "unexplained": answer(
        verdict="unexplained",
        unexplained=(Unexplained("motor_current_A", (1, 2), "voltage", 0.0, 1800.0, 0.1),),
        indistinguishable=(Indistinguishable(("coulomb-friction", "viscous-friction"), "drive a staircase"),),
        notes=("bus_voltage_V was never measured.",),
    ),
}


@pytest.mark.parametrize("verdict", ANSWERS)
def test_the_page_is_whole_and_fetches_nothing(verdict: str, evidence: Evidence) -> None:
    """Every tag is closed, nothing comes from elsewhere, no number is left unsaid as nan or inf."""
    page = render_report(ANSWERS[verdict], evidence, FROM)
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    assert parser.fetched == []
    assert "url(" not in page
    assert "<script" not in page
    said = " ".join(parser.text)
    assert verdict_sentence(ANSWERS[verdict]) in said
    assert not re.search(r"\b(nan|inf)\b", page)
    assert FROM.recording_sha256 in said


def test_the_same_answer_gives_the_same_bytes(evidence: Evidence) -> None:
    """No clock and no chance in the page."""
    assert render_report(ANSWERS["missing-physics"], evidence, FROM) == render_report(
        ANSWERS["missing-physics"], evidence, FROM
    )


def test_a_notebook_shows_the_whole_page_in_a_frame(evidence: Evidence) -> None:
    """The page is an attribute of one frame, escaped, and names no file that there is none of."""
    found = notebook_html(ANSWERS["missing-physics"], evidence)
    assert found.startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')
    assert found.count("<") == 2
    assert "sha256" not in found


def test_an_effect_is_told_with_its_interval_and_its_words_are_escaped(evidence: Evidence) -> None:
    """Current is told in milliamperes; what a statement holds is text, never markup."""
    page = render_report(ANSWERS["missing-physics"], evidence, FROM)
    assert "7.1 … 8.3" in page
    assert "&lt;from&gt;" in page
    assert "wheel 4" in page
    assert "onset 10.2 min" in page


def test_the_verdict_never_names_what_is_unexplained() -> None:
    """One sentence for each verdict; the unknown keeps its place and gets no name."""
    assert verdict_sentence(ANSWERS["missing-physics"]) == "The simulation leaves out bearing drag."
    told = verdict_sentence(ANSWERS["unexplained"])
    assert "bus voltage" in told
    assert "no known effect explains" in told


def test_an_effect_s_curve_shows_its_own_wheels(evidence: Evidence) -> None:
    """The curve of a drag on one wheel is that wheel's residual along its rotation, before and after."""
    rng = np.random.default_rng(1)
    direction = np.where(rng.uniform(size=(900, 6)) > 0.5, 1.0, -1.0)
    drag = np.zeros((900, 6))
    drag[:, 3] = 0.5 * direction[:, 3]
    time_s = np.broadcast_to(evidence.time_s[:, None], (900, 6))
    problem = SimpleNamespace(
        reverses=True, covariates={"time": time_s, "direction": direction}, row=None, mask=np.ones((900, 6), bool)
    )
    noise = 0.01 * rng.normal(size=(900, 6))
    seen = replace(evidence, measured=drag + noise, before=0 * drag, after=drag, problem=problem)  # type: ignore[arg-type]
    curve = curve_of(seen, "time", (4,))
    assert curve is not None
    np.testing.assert_allclose(curve.before, 0.5, atol=0.02)
    np.testing.assert_allclose(curve.after, 0.0, atol=0.02)
    assert curve_of(seen, "wheel_angle", (4,)) is None
    assert curve_of(replace(seen, problem=None), "time", (4,)) is None


def test_labels_have_a_space_for_the_last_hyphen_and_capitals_for_persons() -> None:
    """Derived from the name, or stated by the candidate."""
    assert Labels().effect("multi-pass-compaction") == "multi-pass compaction"
    assert Labels().effect("coulomb-friction") == "Coulomb friction"


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-0.02, 0.033), (5.0, 5.0), (-1800.0, 3600.0)])
def test_ticks_are_round_and_inside(low: float, high: float) -> None:
    """An axis shows round numbers between its ends."""
    found = ticks(low, high)
    assert 1 <= len(found) <= 12
    assert all(low - 1e-9 <= tick <= high + 1e-9 for tick in found)


def test_numbers_are_written_with_a_true_minus() -> None:
    """No hyphen for a minus, no exponent for what a person can read."""
    assert number(-0.00012) == "−0.00012"
    assert number(float("nan")) == "–"
    assert number(61200.0) == "61200"


class Axle(Candidate):
    """Drag of a bearing."""

    name = "axle-drag"
    covariate = "wheel_speed"
    label = "Axle drag"
    parameter_labels: ClassVar = {"drag_N": "drag of the axle"}


def test_another_machine_has_its_own_words(evidence: Evidence) -> None:
    """A column is called what the recording calls it, a covariate what the simulation calls it; seconds where short."""
    labels = Labels.of(
        replace(
            evidence,
            time_s=np.arange(900) / 20,
            wheel_column="axis",
            covariate_labels={"wheel_speed": "carriage speed (m/s)"},
            candidates=(Axle(),),
        )
    )
    assert labels.wheels((1, 2), (1, 2)) == "both axes"
    assert labels.wheels((2,), (1, 2, 3)) == "axis 2"
    assert labels.wheels((1, 3), (1, 2, 3)) == "axes 1, 3"
    assert labels.wheels((1,), (1,)) == ""
    assert labels.axis("wheel_speed") == "carriage speed (m/s)"
    assert labels.covariate("wheel_speed") == "carriage speed"
    assert labels.axis("time") == "time (s)"
    assert labels.effect("axle-drag") == "Axle drag"
    assert labels.parameter("axle-drag", "drag_N") == "drag of the axle"
    assert labels.parameter("axle-drag", "rise_s") == "rise s"


def test_a_page_about_another_machine_has_no_wheels(evidence: Evidence) -> None:
    """Its map and its header speak of axes."""
    page = render_report(answer(), replace(evidence, wheel_column="axis"), FROM)
    assert "<b>6</b> axes" in page
    assert "axis 4" in page
    assert "wheel 4" not in page


def test_an_equation_has_subscripts_and_superscripts_and_no_markup_of_its_own() -> None:
    """What the candidate writes is escaped first."""
    assert equation("Δy = y_c |ω|^p <b>") == "Δy = y<sub>c</sub> |ω|<sup>p</sup> &lt;b&gt;"


@pytest.mark.parametrize(
    ("noun", "expected"), [("wheel", "wheels"), ("axis", "axes"), ("body", "bodies"), ("side", "sides")]
)
def test_plurals_are_english(noun: str, expected: str) -> None:
    """What a column is called is the user's own word."""
    assert plural(noun) == expected


def test_a_sentence_names_the_wheels_only_where_there_are_several() -> None:
    """One axis needs no name."""
    parameters = {"relative_size": Parameter(0.2, 0.1, 0.3, "1"), "onset_s": Parameter(60.0, 50.0, 70.0, "s")}
    told = statement(CoulombFriction.words, (1,), 1, parameters, (2.0, 1.0), "axis")
    assert "axis" not in told
    assert "from 60 s on (90 % sure: 50 to 70 s): 20 % of the mean reading (90 % sure: 10 to 30 %)" in told
    assert "100.0 % larger" in told
    assert "50.0 % smaller" in statement(CoulombFriction.words, (1,), 1, parameters, (1.0, 2.0), "axis")
    several = statement(CoulombFriction.words, (1, 3, 4), 6, parameters, (2.0, 1.0), "axis")
    assert "on axes 1, 3 and 4, from 60 s on" in several


def test_currents_of_amperes_are_in_amperes(evidence: Evidence) -> None:
    """Milliampere only where the mean reading is below one ampere; other units as they are."""
    small, large = Labels.of(evidence), Labels.of(replace(evidence, measured=10 * evidence.measured))
    assert small.scaled("A s²/rad") == (1000.0, "mA s²/rad")
    assert large.scaled("A") == (1.0, "A")
    assert small.scaled("degC") == (1.0, "°C")


def test_an_effect_that_makes_held_out_data_worse_says_so(evidence: Evidence) -> None:
    """The change has one sign."""
    worse = replace(WORN, rmse_before=0.0048, rmse_after=0.0049)
    page = render_report(answer(verdict="missing-physics", effects=(worse,)), evidence, FROM)
    assert "4.8 → 4.9 mA (+2.1 %)" in page
    assert "6.9 → 4.8 mA (−30.4 %)" in render_report(ANSWERS["missing-physics"], evidence, FROM)


def test_what_channels_call_differently_has_its_general_name() -> None:
    """The predicted value is one column in one channel and another in the next; alone each has its own."""
    shared = {"temperature": "water temperature (°C)"}
    thrust = replace(sample_answer.evidence(600.0), covariate_labels={**shared, "torque": "predicted thrust (N)"})
    others = [replace(thrust, covariate_labels={**shared, "torque": f"predicted {n}"}) for n in ("power", "speed")]
    both = replace(thrust, others=tuple(others))
    assert Labels.of(both).the("torque") == "the predicted value"
    assert Labels.of(both).axis("temperature") == "water temperature (°C)"
    assert Labels.of(both, alone=True).axis("torque") == "predicted thrust (N)"
    assert Labels.of(thrust).axis("torque") == "predicted thrust (N)"


def test_the_next_best_answer_is_told_where_it_is_not_negligible() -> None:
    """Names with commas, and something unexplained at the end; nothing below half a percent."""
    labels = Labels.of(sample_answer.evidence(600.0))

    def told(other: OtherAnswer) -> str:
        return certainty(replace(sample_answer.ANSWER, probability=0.934, alternatives=(other,)), labels).next

    frictions = OtherAnswer(("coulomb-friction", "viscous-friction"), True, 0.043)
    assert told(frictions) == "next best: Coulomb friction, viscous friction and something unexplained (0.04)"
    assert told(OtherAnswer((), False, 0.1)) == "next best: nothing missing (0.10)"
    wrong = OtherAnswer((), False, 0.1, ("loss_W_K", "gain"))
    assert told(wrong) == "next best: loss_W_K and gain stated wrongly (0.10)"
    assert told(replace(frictions, probability=0.004)) == ""
    assert certainty(sample_answer.ANSWER, labels).given == "unknown"
    refused = replace(sample_answer.ANSWER, probability=0.07, alternatives=(OtherAnswer((), False, 0.91),))
    doubtful = certainty(refused, labels)
    assert doubtful.next == "refused, though likelier by evidence alone: nothing missing (0.91)"
    assert doubtful.doubt == "more probably wrong than right"
    assert certainty(replace(refused, probability=0.5), labels).doubt == ""
    twin = replace(refused, probability=0.48, alternatives=(OtherAnswer(("coulomb-friction",), False, 0.47),))
    assert certainty(twin, labels).doubt == "no more probable than the next answer"


def test_a_curve_that_several_ranges_have_is_drawn_once(evidence: Evidence) -> None:
    """The other ranges say that it is above."""
    curve = EmpiricalCurve(
        "offset", False, "A", "V", (20.0, 28.0), (0.0, 1e-3), (-1e-4, 9e-4), (1e-4, 2e-3), 6e-3, 5e-3
    )
    place = Unexplained("motor_current_A", (1, 2), "voltage", 0.0, 900.0, 0.1, curve=curve)
    page = render_report(
        answer(verdict="unexplained", unexplained=(place, replace(place, to_s=1800.0))), evidence, FROM
    )
    assert page.count("Empirical curve: no physics is known for it.") == 1
    assert page.count("A range of what is drawn above, with the same curve.") == 1
