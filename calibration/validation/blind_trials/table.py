"""The score as tables for the terminal: the solver with its goals, and the baselines beside it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.table import Table

if TYPE_CHECKING:
    from regolithd.calibration.validation.blind_trials.score import Figures

ROWS = (
    ("exact_set", "exact set of names", "≥ 97 %", 0.97, None),
    ("false_name_on_nothing", "a name where nothing is concealed", "≤ 1 %", None, 0.01),
    ("outside_unexplained_and_located", "out of library: unexplained and located", "≥ 95 %", 0.95, None),
    ("wheels_right", "the right wheels", "≥ 98 %", 0.98, None),
    ("onset_within_tenth", "onset within 10 % of the length", "all", 1.0, None),
    ("intervals_hold", "90 % intervals that contain the truth", "88–92 %", 0.88, 0.92),
    ("held_out_within_2_percent", "held-out error within 2 % of the true model's", "all", 1.0, None),
    ("constant_speed_undecided", "constant speed: indistinguishable set and experiment", "≥ 95 %", 0.95, None),
    (
        "constant_speed_decided_by_experiment",
        "its experiment leads to the right name",
        "≥ 95 %",
        0.95,
        None,
    ),
)
"""Key of the figure, label, goal as text, lowest and highest value of the goal."""


def score_table(figures: Figures) -> Table:
    """Return the solver's score with its goals."""
    table = Table(title=f"{figures['recordings']} recordings, commitments opened", title_justify="left")
    table.add_column("figure")
    table.add_column("reached", justify="right")
    table.add_column("goal", justify="right", style="dim")
    for key, label, goal, lowest, highest in ROWS:
        value = float(figures.get(key, math.nan))
        if math.isnan(value):
            table.add_row(label, "–", goal)
            continue
        good = (lowest is None or value >= lowest) and (highest is None or value <= highest)
        table.add_row(label, f"[{'green' if good else 'red'}]{100 * value:.1f} %[/]", goal)
    table.add_row("seconds per recording, median", f"{float(figures['seconds_median']):.1f}", "20")
    return table


def baselines_table(figures: Figures) -> Table:
    """Return the scores of solver and baselines."""
    table = Table(title="baselines on the same recordings", title_justify="left")
    for heading in ("tool", "exact set", "a name on nothing", "a name out of library", "s"):
        table.add_column(heading, justify="left" if heading == "tool" else "right")
    rows = [("regolithd mismatch", "")] + [
        (key.removeprefix("peer_").removesuffix("_exact_set").replace("_", " "), key.removesuffix("exact_set"))
        for key in figures
        if key.startswith("peer_") and key.endswith("_exact_set")
    ]
    for name, prefix in rows:
        shares = [float(figures[prefix + key]) for key in ("exact_set", "false_name_on_nothing", "outside_named")]
        seconds = float(figures[f"{prefix}seconds_median"])
        table.add_row(name, *("–" if math.isnan(s) else f"{100 * s:.0f} %" for s in shares), f"{seconds:.2f}")
    return table
