"""The answer of `regolithd mismatch` as the terminal shows it."""

from __future__ import annotations

from types import SimpleNamespace

from rich.console import Console

from regolithd.calibration.mismatch.answer import CalibratedParameter, Parameter, Suggestion, Unexplained
from regolithd.calibration.mismatch.problem.empirical_curve import EmpiricalCurve
from regolithd.daemon.mismatch.terminal import print_answer

CURVE = EmpiricalCurve("offset", False, "A", "m", (0.1, 0.7), (0.0, 1.5), (-0.1, 1.4), (0.1, 1.6), 0.004, 0.002)
SUGGESTIONS = (Suggestion("power", "Δcurrent = c height", {"c": Parameter(2.5, 2.0, 3.0, "A/m")}, 0.0021, 0.0),)


def test_mismatch_prints_the_answer() -> None:
    """Verdict, effects, what is unexplained or not distinguished, how sure it is, held-out error and notes."""
    answer = SimpleNamespace(
        verdict="effects",
        effects=[SimpleNamespace(name="coulomb-friction", statement="37 mA")],
        unexplained=[
            Unexplained("current", (1, 4), "time", 3.4, 99.6, 0.123),
            Unexplained("current", (1,), "height", 0.0, 9.0, 0.4, curve=CURVE, suggestions=SUGGESTIONS),
        ],
        indistinguishable=[SimpleNamespace(effects=("one", "other"), experiment="Drive backwards.")],
        fit=SimpleNamespace(
            channel="current", held_out_rmse_before=0.00412345, held_out_rmse_after=0.001, noise_floor_rmse=0.0009
        ),
        parameters=[
            CalibratedParameter("loss", "W/K", 4.0, 0.16, 4.97, 4.9, 5.0),
            CalibratedParameter("gain", "1", 1.0, 0.1, 1.2, 1.1, 1.3),
        ],
        probability=0.914,
        next_best=SimpleNamespace(effects=("other",), unexplained=True, probability=0.05),
        notes=["short"],
    )
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, answer)
    assert console.export_text().splitlines() == [
        "effects",
        "  coulomb-friction: 37 mA",
        "  parameter loss: 4.97 W/K instead of 4, 6.1 standard deviations of its prior away",
        "  unexplained: 12 % of the residual follows time on 1, 4, 3 to 100 s",
        "  unexplained: 40 % of the residual follows height on 1, 0 to 9 s",
        "  with an empirical curve over height, 0.1 to 0.7 m: held-out error 0.004 before, 0.002 after",
        "  suggestion 1: Δcurrent = c height; c = 2.5 A/m; held-out error 0.0021",
        "  one or other: this recording does not distinguish them. Drive backwards.",
        "  probability of this set of names: 0.91; next: other + something unexplained (0.05)",
        "  held-out error of current: 0.0041234 before, 0.001 after, noise floor 0.0009",
        "  note: short",
    ]
