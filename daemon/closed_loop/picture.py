"""Draw the study: one row for each case, with drag current, estimates before and after, and errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from regolithd.calibration.drivetrain.torque import no_load_current
from regolithd.calibration.parameters import SOILS, Drivetrain
from regolithd.calibration.validation.reproduction.pictures import save
from regolithd.daemon.closed_loop.case import OTHER_SOILS
from regolithd.daemon.closed_loop.soil_estimates import UNITS, figures
from regolithd.daemon.closed_loop.summary import found_effect, hidden_effect

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from regolithd.daemon.closed_loop.run import LoopResult
    from regolithd.daemon.closed_loop.soil_estimates import SoilEstimates

TRUTH, BEFORE, AFTER = "#1a1a1a", "#8c96a0", "#c0392b"
STYLE: Any = {
    "font.size": 12.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 13,
    "legend.frameon": False,
    "svg.hashsalt": "regolithd",
    "figure.facecolor": "white",
}
SPEEDS_RAD_S = np.linspace(0.0, 0.45, 50)
HIGHEST, HIGHEST_ERROR = (12.5, 45.0), (6.8, 12.5)
"""Upper limits of the axes for cohesion [kPa] and friction angle [°]."""
POINTS = 100
"""Points of a trace: a window of 10 s changes little from one half second to the next."""
SYMBOLS = (("c", "kPa"), ("φ", "°"))
TITLE = "Friction hidden in the drivetrain, found by one drive on a known soil – then the same rover on other soils"


def draw(runs: Sequence[LoopResult], path: Path) -> None:
    """Draw the cases, one below the other; equal results give equal bytes."""
    with mpl.rc_context(STYLE):
        made = Figure(figsize=(15, 1.8 + 3.1 * len(runs)), layout="constrained")
        made.suptitle(TITLE, x=0.008, ha="left", fontsize=16, fontweight="bold")
        rows = made.subfigures(len(runs), 1, squeeze=False)[:, 0]
        for result, row in zip(runs, rows, strict=True):
            row.suptitle(_headline(result), x=0.008, ha="left", fontsize=13.5)
            panels = row.subplots(1, 5, width_ratios=(0.95, 1.7, 1.7, 0.9, 0.9))
            _drag(panels[0], result)
            for k, label in enumerate(("cohesion c [kPa]", "friction angle φ [°]")):
                _trace(panels[1 + k], result, k, label)
                _errors(panels[3 + k], result, k)
        made.legend(handles=_legend(), loc="outside lower left", ncols=4)
        save(made, path, dpi=130)


def _legend() -> list[Line2D]:
    """Return the lines of the legend, which all panels share."""
    return [
        Line2D([], [], color=BEFORE, linewidth=5, label="with rover.toml before"),
        Line2D(
            [], [], color=AFTER, linewidth=5, linestyle=(0, (1.6, 0.6)), label="with rover.toml after the comparison"
        ),
        Line2D([], [], color=TRUTH, linewidth=5, label="true (errors: with the true drivetrain)"),
    ]


def _headline(result: LoopResult) -> str:
    """Return hidden effect, named effects and errors in one line."""
    if not result.names:
        return f"Hidden: {hidden_effect(result)}.   Found: {found_effect(result)}.   rover.toml unchanged."
    before, after = figures(result.before), figures(result.after)
    errors = ", ".join(
        f"{symbol} {before[f'posterior_rmse_{name}']:.1f} → {after[f'posterior_rmse_{name}']:.1f} {unit}"
        for name, (symbol, unit) in zip(UNITS, SYMBOLS, strict=True)
    )
    return f"Hidden: {hidden_effect(result)}.   Found: {found_effect(result)}.   Error of the posterior: {errors}."


def _drag(panel: Axes, result: LoopResult) -> None:
    """Draw the no-load current over wheel speed: true, and of `rover.toml` before and after."""
    known = {name: value for name, value in result.case.known.items() if not name.endswith("_std_A")}
    lines = (
        (Drivetrain.model_validate({**known, **result.case.hidden}), TRUTH, "-", 2.5, "true"),
        (Drivetrain.model_validate(known), BEFORE, "-", 1.8, "rover.toml before"),
        (result.configuration.drivetrain, AFTER, "--", 1.8, "rover.toml after"),
    )
    for drivetrain, colour, dashes, width, label in lines:
        current = no_load_current(np.maximum(SPEEDS_RAD_S, 1e-6)[:, None] * drivetrain.ratio, drivetrain)[:, 0]
        panel.plot(SPEEDS_RAD_S, 1e3 * current, dashes, color=colour, linewidth=width, label=label)
    panel.set(ylim=(-2, 72), xlabel="wheel speed [rad/s]", ylabel="drag current [mA]", title="drivetrain drag")


def _trace(panel: Axes, result: LoopResult, k: int, label: str) -> None:
    """Draw cohesion (k = 0) or friction angle (k = 1) along the second drive."""
    withheld = "" if any(name.startswith("no_load") for name in result.case.known) else " (the daemon withholds it)"
    shown = [(result.before, BEFORE, f"before{withheld}"), (result.after, AFTER, "after")]
    for estimates, colour, name in shown if result.changes else [(result.before, AFTER, "before and after")]:
        there = np.flatnonzero(np.isfinite(estimates.mean[:, k]))
        at = there[:: max(1, len(there) // POINTS)]
        time, values = estimates.time_s[at], [each[at, k] for each in (estimates.low, estimates.mean, estimates.high)]
        panel.fill_between(time, values[0], values[2], color=colour, alpha=0.18, linewidth=0)
        panel.plot(time, values[1], color=colour, linewidth=1.3, label=name)
    panel.plot(result.before.time_s, result.before.truth[:, k], color=TRUTH, linewidth=2, label="true")
    panel.set(ylim=(0, HIGHEST[k]), xlim=(0, result.before.time_s[-1]), xlabel="time of the second drive [s]")
    panel.set_title(label)
    _name_soils(panel, result.before)


def _name_soils(panel: Axes, estimates: SoilEstimates) -> None:
    """Write each soil's name over the time that all wheels are on it."""
    for name in OTHER_SOILS:
        there = estimates.time_s[np.isclose(estimates.truth[:, 0], SOILS[name].cohesion_Pa / 1e3)]
        if there.size:
            panel.text(float(there.mean()), 0.25, name, ha="center", va="bottom", fontsize=10.5, color="#444444")


def _errors(panel: Axes, result: LoopResult, k: int) -> None:
    """Draw the root mean square errors of the posterior and of the paper's network."""
    symbol, unit = SYMBOLS[k]
    bars = (
        ("before", result.before, BEFORE),
        ("after", result.after, AFTER),
        ("true drivetrain", result.with_true_drivetrain, TRUTH),
    )
    for step, (label, estimates, colour) in enumerate(bars):
        found_here = figures(estimates)
        values = [found_here[f"{estimator}_rmse_{UNITS[k]}"] for estimator in ("posterior", "network")]
        places = [step, step + 4]
        panel.bar(places, values, color=colour, width=0.9, alpha=0.85, label=label)
        for at, value in zip(places, values, strict=True):
            panel.text(at, value + 0.015 * HIGHEST_ERROR[k], f"{value:.1f}", ha="center", fontsize=9.5)
    panel.set(ylim=(0, HIGHEST_ERROR[k]), title=f"error of {symbol} [{unit}]")
    panel.set_xticks([1, 5], ["posterior", "paper's\nnetwork"])
    panel.tick_params(axis="x", length=0)
