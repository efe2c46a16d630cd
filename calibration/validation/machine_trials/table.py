"""The score as people read it: machines across, kinds of case down, and what was wrong with each case."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from regolithd.calibration.validation.machine_trials.cases.plan import KINDS
from regolithd.calibration.validation.machine_trials.machines import MACHINES

if TYPE_CHECKING:
    from regolithd.calibration.validation.machine_trials.score import Figures, Verdict

GRAVE = (
    ("consistent_over_effect", "`consistent` over an effect of 10 % of the mean reading"),
    ("named_on_nothing", "a name where nothing is concealed"),
)
SHARES = (
    ("right", "right"),
    ("right_but_for_onsets", "right but for onsets"),
    ("no_answer", "no answer"),
    ("outside_located", "outside the list: located"),
    ("intervals_hold", "90 % intervals of effects that hold the truth"),
    ("parameter_intervals_hold", "90 % intervals of parameters that hold the truth"),
    ("held_out_within_2_percent", "held-out error within 2 % of the true model's"),
)


def score_table(figures: Figures) -> Table:
    """Return right cases of all, machine by kind."""
    table = Table(title=f"{figures['cases']} cases, right of all", title_justify="left")
    table.add_column("kind", no_wrap=True)
    for machine in (*MACHINES, "all"):
        table.add_column(machine, justify="right")
    for kind in KINDS:
        keys = [f"{machine}_{kind}" for machine in MACHINES] + [f"kind_{kind}"]
        table.add_row(kind, *(cell(figures, key) for key in keys))
    total = f"{sum(int(figures[f'kind_{k}_right'] or 0) for k in seen(figures))}/{figures['cases']}"
    table.add_row("all", *(cell(figures, f"machine_{machine}") for machine in MACHINES), total)
    return table


def seen(figures: Figures) -> list[str]:
    """Return the kinds that occurred, as the figures spell them."""
    return [kind for kind in (one.replace("-", "_") for one in KINDS) if f"kind_{kind}_right" in figures]


def cell(figures: Figures, key: str) -> str:
    """Return one cell of the table: right of all, or a dash."""
    flat = key.replace("-", "_")
    return f"{figures[f'{flat}_right']}/{figures[f'{flat}_cases']}" if f"{flat}_cases" in figures else "–"


def shares_table(figures: Figures) -> Table:
    """Return the grave errors and the shares."""
    table = Table("what", "reached")
    for key, words in GRAVE:
        table.add_row(words, str(figures[key]))
    for key, words in SHARES:
        value = figures[key]
        table.add_row(words, "–" if value is None else f"{100 * value:.0f} %")
    table.add_row("seconds a case, median", f"{figures['seconds_median']:.1f}")
    return table


def line(verdict: Verdict) -> str:
    """Return one line on a case: which, and everything that is wrong with it."""
    grave = "GRAVE " if verdict.consistent_over_effect or verdict.named_on_nothing else ""
    head = f"{verdict.machine} {verdict.kind} {verdict.index}"
    if verdict.right:
        return escape(f"{head}: right ({listed_names(verdict)}), {verdict.seconds:.0f} s")
    return escape(
        f"{head}: {grave}{'; '.join(' '.join(p.split()) for p in (*verdict.problems, *verdict.onset_problems))}"
    )


def listed_names(verdict: Verdict) -> str:
    """Return what was named, or the verdict."""
    return ", ".join(verdict.named) or verdict.verdict
