"""The answer of `regolithd mismatch` as the terminal shows it."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from types import SimpleNamespace

from rich.console import Console

from regolithd.calibration.mismatch.answer import (
    Answer,
    CalibratedParameter,
    FitImprovement,
    Indistinguishable,
    Parameter,
    Suggestion,
    Unexplained,
)
from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer, FleetUnexplained
from regolithd.calibration.mismatch.inference.statements import NO_HELP
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve
from regolithd.calibration.mismatch.report.labels import Labels
from regolithd.daemon.mismatch.terminal import print_answer

CURVE = EmpiricalCurve("offset", False, "A", "m", (0.1, 0.7), (0.0, 1.5), (-0.1, 1.4), (0.1, 1.6), 0.004, 0.002)
SUGGESTIONS = (Suggestion("power", "Δcurrent = c height", {"c": Parameter(2.5, 2.0, 3.0, "A/m")}, 0.0021, 0.0),)

GROWN = SimpleNamespace(
    name="viscous-friction",
    channel="current",
    statement="viscous-friction is larger than the corrected simulation has it.",
)
WERE_THERE = "If there were one, this recording would not tell which."
LEFT = (
    "4.97 W/K instead of 4 ± 0.16, 6.1 standard deviations away. Check the stated value and its standard "
    "deviation, or look for physics that acts as this parameter does."
)


FRICTION = {
    "coulomb_current": Parameter(0.03712, 0.03, 0.044, "A"),
    "power": Parameter(0.75, float("nan"), float("nan"), "1"),
    "onset_s": Parameter(3.0, 1.0, 9.0, "s"),
    "relative_size": Parameter(0.2, 0.1, 0.3, "1"),
}
WITH_MORE = "coulomb-friction with more beside it"


def answer_with(**parts: object) -> SimpleNamespace:
    """Return an answer that has these parts alone."""
    empty: dict[str, object] = {
        **dict.fromkeys(("effects", "changes", "unexplained", "indistinguishable", "parameters", "notes"), ()),
        "fit": SimpleNamespace(channel="a", held_out_rmse_before=1.0, held_out_rmse_after=1.0, noise_floor_rmse=1.0),
        "fits": (),
        "probability": None,
        "next_best": None,
    }
    return SimpleNamespace(**{**empty, **parts})


def test_mismatch_prints_the_answer() -> None:
    """Verdict, effects, what is unexplained or not distinguished, how sure it is, held-out error and notes."""
    answer = SimpleNamespace(
        verdict="effects",
        effects=[SimpleNamespace(name="coulomb-friction", statement="37 mA", parameters=FRICTION)],
        unexplained=[
            Unexplained("current", (1, 4), "time", 3.4, 99.6, 0.123, period=150.0),
            Unexplained("current", (1,), "height", 0.0, 9.0, 0.4, curve=CURVE, suggestions=SUGGESTIONS),
        ],
        changes=[GROWN],
        indistinguishable=[
            Indistinguishable(("coulomb-friction", "other", "more"), "Drive backwards.", beside=("more",)),
            Indistinguishable(("quadratic-drag", "viscous-friction"), "Drive up."),
            Indistinguishable(("one", "stribeck-friction"), "Drive fast."),
        ],
        fit=SimpleNamespace(
            channel="current", held_out_rmse_before=0.00412345, held_out_rmse_after=0.001, noise_floor_rmse=0.0009
        ),
        parameters=[
            CalibratedParameter("loss", "W/K", 4.0, 0.16, 4.97, 4.9, 5.0),
            CalibratedParameter("gain", "1", 1.0, 0.1, 1.2, 1.1, 1.3),
        ],
        probability=0.914,
        next_best=SimpleNamespace(effects=("other",), unexplained=True, probability=0.05, parameters=()),
        fits=(),
        notes=["short", "in b: loss had to leave its prior: 4.97 W/K."],
    )
    console = Console(record=True, width=200, quiet=False)
    corrected = frozenset({"viscous-friction", "stribeck-friction"})
    labels = Labels("zone", {"height": "height of the bale (m)"}, corrected=corrected)
    print_answer(console, answer, labels, (1, 2, 3, 4))
    assert console.export_text().splitlines() == [
        "effects",
        "  coulomb-friction: 37 mA",
        "    coulomb_current = 0.037 A (90 % sure: 0.030 to 0.044)",
        "    power = 0.75",
        "  changed: viscous-friction is larger than the corrected simulation has it.",
        f"  parameter loss had to leave its prior: {LEFT}",
        "  unexplained: 12 % of the residual follows time, with a period of 150 s, on zones 1 and 4, 3 to 100 s",
        "  unexplained: 40 % of the residual follows the height of the bale, on zone 1, 0 to 9 s",
        "    empirical curve over the height of the bale, 0.1 to 0.7 m: held-out error 50.0 % smaller with it",
        "    suggestion 1: Δcurrent = c height; c = 2.5 A/m; 47.5 % smaller",
        f"  coulomb-friction or other, or {WITH_MORE}: this recording does not distinguish them. Drive backwards.",
        "  quadratic-drag or viscous-friction (changed): this recording does not distinguish them. Drive up.",
        "  probability of this answer: 0.91; next: other + something unexplained (0.05)",
        "  held-out error of current: 0.0041234 before, 0.001 after, noise floor 0.0009",
        f"  not found: one or stribeck-friction (changed). {WERE_THERE} Drive fast.",
        "  note: short",
    ]


def test_of_several_channels_each_finding_and_each_error_names_its_own() -> None:
    """An error that no effect changed is told once."""
    fits = [
        SimpleNamespace(channel=name, held_out_rmse_before=1.5, held_out_rmse_after=after, noise_floor_rmse=1.0)
        for name, after in (("pressure", 1.5), ("current", 1.25))
    ]
    answer = answer_with(
        verdict="unexplained",
        effects=[
            SimpleNamespace(name="sensor-delay", channel="current", statement="A delay of pressure.", parameters={})
        ],
        changes=[GROWN],
        unexplained=[
            Unexplained("pressure", (1,), "flow", 0.0, 9.0, 0.4),
            Unexplained("pressure", (1,), "speed", 0.0, 9.0, 0.0049),
        ],
        fit=fits[1],
        fits=fits,
    )
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, answer, Labels(), (1,))
    assert console.export_text().splitlines() == [
        "unexplained",
        "  sensor-delay in current: A delay of pressure.",
        "  changed in current: viscous-friction is larger than the corrected simulation has it.",
        "  unexplained in pressure: 40 % of the residual follows the flow, 0 to 9 s",
        "  unexplained in pressure: less than 1 % of the residual follows the speed, 0 to 9 s",
        "  probability of this answer: not known: what is unexplained was not decided by the evidence of a curve",
        "  held-out error of pressure: 1.5, noise floor 1",
        "  held-out error of current: 1.5 before, 1.25 after, noise floor 1",
    ]


def test_a_curve_that_does_not_help_where_it_was_not_fitted_is_told_with_a_caution() -> None:
    """Under the curve; an error that changes by less than is told is the same."""
    useless = replace(CURVE, held_out_rmse_after=0.0039999)
    unexplained = [Unexplained("current", (1,), "height", 0.0, 9.0, 0.4, curve=useless)]
    answer = answer_with(verdict="unexplained", unexplained=unexplained)
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, answer, Labels(), (1,))
    assert console.export_text().splitlines()[2:4] == [
        "    empirical curve over the height, 0.1 to 0.7 m: held-out error the same with it",
        f"    caution: {NO_HELP}",
    ]


def test_a_terminal_gets_continued_lines_indented() -> None:
    """A line is broken at its width, never between a number and its percent sign, and goes on under its beginning."""
    drag = SimpleNamespace(
        name="viscous-friction", statement="Drag that grows with speed: 37 % of the mean.", parameters={}
    )
    answer = answer_with(verdict="missing-physics", effects=[drag])
    console = Console(record=True, width=51, force_terminal=True, file=StringIO())
    print_answer(console, answer, Labels(), (1,))
    assert console.export_text().splitlines()[1:3] == [
        "  viscous-friction: Drag that grows with speed:",
        "    37 % of the mean.",
    ]


def test_a_curve_of_several_regions_is_told_once() -> None:
    """Each region has its line."""
    regions = [
        Unexplained("current", (1,), "height", 0.0, 9.0, share, curve=CURVE, suggestions=SUGGESTIONS)
        for share in (0.4, 0.1)
    ]
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, answer_with(verdict="unexplained", unexplained=regions), Labels(), (1,))
    text = console.export_text()
    assert text.count("unexplained: ") == 2
    assert text.count("empirical curve") == text.count("suggestion 1") == 1


def test_an_answer_that_evidence_alone_disfavours_says_so() -> None:
    """A test of its own refused the other one."""
    console = Console(record=True, width=200, quiet=False)
    other = SimpleNamespace(effects=(), unexplained=False, probability=0.91, parameters=())
    print_answer(console, answer_with(verdict="unexplained", probability=0.07, next_best=other), Labels(), (1,))
    assert (
        "probability of this answer: 0.07; refused, though likelier by evidence alone: nothing (0.91)"
        in console.export_text(clear=False)
    )
    assert console.export_text().splitlines()[0] == "unexplained, more probably wrong than right"


def test_what_a_fleet_leaves_unexplained_names_recording_and_rover() -> None:
    """And what several recordings do not distinguish is told of several."""
    fit = FitImprovement("current", 1.0, 1.0, 1.0)
    rest = [
        FleetUnexplained("current", (1,), "height", 0.0, 9.0, 0.4, rovers=(rover,), recordings=("a.csv", "b.csv"))
        for rover in ("asper", "rover")
    ]
    sets = (Indistinguishable(("one", "other"), "Drive fast."),)
    answer = FleetAnswer("unexplained", (), tuple(rest), sets, (), fit, ())
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, answer, Labels())
    told = console.export_text().splitlines()
    assert [*told[1:3], told[5]] == [
        "  unexplained in a.csv and b.csv of asper: 40 % of the residual follows the height, on wheel 1, 0 to 9 s",
        "  unexplained in a.csv and b.csv: 40 % of the residual follows the height, on wheel 1, 0 to 9 s",
        "  not found: one or other. If there were one, these recordings would not tell which. Drive fast.",
    ]


def test_what_one_of_several_columns_does_not_distinguish_names_the_column() -> None:
    """With one predicted column there is no need to."""
    fits = tuple(FitImprovement(name, 1.0, 1.0, 1.0) for name in ("current", "voltage"))
    sets = (Indistinguishable(("one", "other"), "Drive fast.", channel="voltage"),)
    told = []
    for of in (fits, fits[1:]):
        answer = Answer("consistent", (), (), sets, (), fits[1], fits=of)
        console = Console(record=True, width=200, quiet=False)
        print_answer(console, answer, Labels())
        told += [line for line in console.export_text().splitlines() if "not found" in line]
    assert [line.split(".")[0].strip() for line in told] == [
        "not found: one or other in voltage",
        "not found: one or other",
    ]


def test_of_many_sets_without_a_finding_two_are_told() -> None:
    """Each has an experiment of some lines; the rest is counted."""
    fit = FitImprovement("current", 1.0, 1.0, 1.0)
    sets = tuple(Indistinguishable((f"one-{k}", f"other-{k}"), "Drive fast.") for k in range(5))
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, Answer("consistent", (), (), sets, (), fit), Labels())
    told = [line.strip() for line in console.export_text().splitlines() if "not found" in line]
    assert [line.split(".")[0] for line in told] == [
        "not found: one-0 or other-0",
        "not found: one-1 or other-1",
        "not found: 3 more such sets (--report or --json)",
    ]
