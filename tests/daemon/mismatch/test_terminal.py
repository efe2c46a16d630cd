"""The answer of `regolithd mismatch` as the terminal shows it."""

from __future__ import annotations

from types import SimpleNamespace

from rich.console import Console

from regolithd.daemon.mismatch.terminal import print_answer


def test_mismatch_prints_the_answer() -> None:
    """Verdict, effects, what is unexplained or not distinguished, how sure it is, held-out error and notes."""
    answer = SimpleNamespace(
        verdict="effects",
        effects=[SimpleNamespace(name="coulomb-friction", statement="37 mA")],
        unexplained=[
            SimpleNamespace(share_of_residual=0.123, covariate="time", wheels=(1, 4), from_s=3.4, to_s=99.6),
        ],
        indistinguishable=[SimpleNamespace(effects=("one", "other"), experiment="Drive backwards.")],
        fit=SimpleNamespace(
            channel="current", held_out_rmse_before=0.00412345, held_out_rmse_after=0.001, noise_floor_rmse=0.0009
        ),
        probability=0.914,
        alternatives=[SimpleNamespace(effects=("other",), unexplained=True, probability=0.05)],
        notes=["short"],
    )
    console = Console(record=True, width=200, quiet=False)
    print_answer(console, answer)
    assert console.export_text().splitlines() == [
        "effects",
        "  coulomb-friction: 37 mA",
        "  unexplained: 12 % of the residual follows time on 1, 4, 3 to 100 s",
        "  one or other: this recording does not distinguish them. Drive backwards.",
        "  probability of this set of names: 0.91; next: other + something unexplained (0.05)",
        "  held-out error of current: 0.0041234 before, 0.001 after, noise floor 0.0009",
        "  note: short",
    ]
