"""What was measured and what was fitted, wheel by wheel: pictures for the person at the bench."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from regolithd.calibration.drivetrain.bench.efficiency import Efficiency
    from regolithd.calibration.drivetrain.bench.procedures import Radius

Array = NDArray[np.float64]
Fit = tuple[Array, Array, Callable[[Array], Array]]
"""Measured x and y, and the fitted line."""

STYLE: Any = {"svg.hashsalt": "regolithd", "font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
MEASURED, FITTED = "#7f8c8d", "#c0392b"
NINE_TENTHS = 1.645
"""Standard deviations on either side that hold nine tenths."""


@dataclass(frozen=True, slots=True)
class Braked:
    """One wheel under a brake: what was measured, what was fitted, and the gain of gears without losses."""

    torque_Nm: Array
    current_A: Array
    fit: Efficiency
    ideal_gain_Nm_per_A: float


def draw(path: Path, wheels: dict[int, Fit], x_label: str, y_label: str) -> None:
    """Write one panel for each wheel: points, and the fitted line."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3 * -(-len(wheels) // 3)), layout="constrained")
        panels = figure.subplots(-(-len(wheels) // 3), min(3, len(wheels)), squeeze=False, sharex=True, sharey=True)
        for panel in panels.flat[len(wheels) :]:
            panel.set_visible(False)
        for panel, (wheel, (x, y, fit)) in zip(panels.flat, sorted(wheels.items()), strict=False):
            panel.plot(x, y, ".", color=MEASURED, markersize=2, alpha=0.6)
            line = np.linspace(x.min(), x.max(), 400)
            panel.plot(line, fit(line), color=FITTED)
            panel.set_title(f"wheel {wheel}", loc="left")
        figure.supxlabel(x_label)
        figure.supylabel(y_label)
        _save(figure, path)


def draw_brake(path: Path, wheels: dict[int, Braked]) -> None:
    """Write for each wheel the current against the brake's torque, and the efficiency that follows from it."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.2 * len(wheels)), layout="constrained")
        rows = figure.subplots(len(wheels), 2, squeeze=False, sharex=True)
        for (left, right), (wheel, braked) in zip(rows, sorted(wheels.items()), strict=True):
            _current(left, braked)
            _efficiency(right, braked)
            left.set_title(f"wheel {wheel}", loc="left")
        rows[0, 1].legend(frameon=False, loc="lower right")
        figure.supxlabel("brake torque [N m]")
        _save(figure, path)


def _current(panel: Axes, braked: Braked) -> None:
    line = np.linspace(0, braked.torque_Nm.max(), 200)
    fitted, std = braked.fit.line(line), NINE_TENTHS * braked.fit.line_std(line)
    panel.plot(braked.torque_Nm, 1e3 * braked.current_A, ".", color=MEASURED, markersize=2, alpha=0.6)
    panel.fill_between(line, 1e3 * (fitted - std), 1e3 * (fitted + std), color=FITTED, alpha=0.2, linewidth=0)
    panel.plot(line, 1e3 * fitted, color=FITTED)
    panel.set_ylabel("motor current [mA]")
    panel.set_ylim(bottom=0)


def _efficiency(panel: Axes, braked: Braked) -> None:
    line = np.linspace(0, braked.torque_Nm.max(), 200)[1:]
    share, std = braked.fit.efficiency(line, braked.ideal_gain_Nm_per_A)
    low, high = share - NINE_TENTHS * std, share + NINE_TENTHS * std
    levels = np.unique(braked.torque_Nm)
    means = np.array([braked.current_A[braked.torque_Nm == level].mean() for level in levels])
    at_levels = levels / (braked.ideal_gain_Nm_per_A * means)
    panel.plot(levels, 100 * at_levels, "o", color=MEASURED, markersize=4, label="mean at each torque")
    panel.fill_between(line, 100 * low, 100 * high, color=FITTED, alpha=0.2, linewidth=0, label="90 %")
    panel.plot(line, 100 * share, color=FITTED, label="fitted")
    panel.set_ylabel("efficiency, no-load current and all [%]")
    panel.set_ylim(bottom=0)


def draw_radius(path: Path, rolled: dict[int, tuple[Array, Array]], found: dict[int, Radius], mean: Radius) -> None:
    """Write how the wheels turned (time [s] and speed at the wheel [rad/s]), and the radius of each with all's mean."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.4), layout="constrained")
        left, right = figure.subplots(1, 2)
        for wheel, (time, speed) in sorted(rolled.items()):
            left.plot(time, speed, linewidth=0.8, label=f"wheel {wheel}")
        left.set_xlabel("time [s]")
        left.set_ylabel("speed of the wheel [rad/s]")
        left.set_title("start and stop must both be in the recording", loc="left")
        left.legend(frameon=False, fontsize=7, ncols=2)
        low, high = (1e3 * (mean.radius_m + side * NINE_TENTHS * mean.radius_std_m) for side in (-1, 1))
        right.axhspan(low, high, color=FITTED, alpha=0.2, linewidth=0)
        right.axhline(1e3 * mean.radius_m, color=FITTED, label="written; 90 %")
        wheels = sorted(found)
        values, deviations = (
            [1e3 * getattr(found[wheel], name) for wheel in wheels] for name in ("radius_m", "radius_std_m")
        )
        bars = NINE_TENTHS * np.array(deviations)
        right.errorbar(wheels, values, bars, fmt="o", color=MEASURED, capsize=3, label="each wheel; 90 %")
        right.set_xticks(wheels)
        right.set_xlabel("wheel")
        right.set_ylabel("radius [mm]")
        right.legend(frameon=False)
        _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
