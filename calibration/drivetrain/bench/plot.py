"""Figures of the bench calibration: measurements and fit of each wheel."""

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

    from regolithd.calibration.drivetrain.bench.efficiency_fit import EfficiencyFit
    from regolithd.calibration.drivetrain.bench.procedures import RadiusFit

Array = NDArray[np.float64]
PlottedFit = tuple[Array, Array, Callable[[Array], Array]]
"""Measured x and y, and the fitted function."""

STYLE: Any = {"svg.hashsalt": "regolithd", "font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
MEASURED, FITTED = "#7f8c8d", "#c0392b"
STD_90 = 1.645
"""Half width of a 90 % interval in standard deviations (normal distribution)."""


@dataclass(frozen=True, slots=True)
class BrakeTest:
    """One wheel under a brake: measurements, fit, and the gain without losses κ ζ_PG ζ_HD."""

    torque_Nm: Array
    current_A: Array
    fit: EfficiencyFit
    ideal_gain_Nm_per_A: float


def plot_fits(path: Path, wheels: dict[int, PlottedFit], x_label: str, y_label: str) -> None:
    """Write a figure with one panel for each wheel: measurements, and the fitted function."""
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


def plot_brake(path: Path, wheels: dict[int, BrakeTest]) -> None:
    """Write a figure with the current and the efficiency of each wheel against the brake's torque."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.2 * len(wheels)), layout="constrained")
        rows = figure.subplots(len(wheels), 2, squeeze=False, sharex=True)
        for (left, right), (wheel, test) in zip(rows, sorted(wheels.items()), strict=True):
            _plot_current(left, test)
            _plot_efficiency(right, test)
            left.set_title(f"wheel {wheel}", loc="left")
        rows[0, 1].legend(frameon=False, loc="lower right")
        figure.supxlabel("brake torque [N m]")
        _save(figure, path)


def _plot_current(panel: Axes, test: BrakeTest) -> None:
    line = np.linspace(0, test.torque_Nm.max(), 200)
    fitted, std = test.fit.line(line), STD_90 * test.fit.line_std(line)
    panel.plot(test.torque_Nm, 1e3 * test.current_A, ".", color=MEASURED, markersize=2, alpha=0.6)
    panel.fill_between(line, 1e3 * (fitted - std), 1e3 * (fitted + std), color=FITTED, alpha=0.2, linewidth=0)
    panel.plot(line, 1e3 * fitted, color=FITTED)
    panel.set_ylabel("motor current [mA]")
    panel.set_ylim(bottom=0)


def _plot_efficiency(panel: Axes, test: BrakeTest) -> None:
    line = np.linspace(0, test.torque_Nm.max(), 200)[1:]
    share, std = test.fit.efficiency(line, test.ideal_gain_Nm_per_A)
    low, high = share - STD_90 * std, share + STD_90 * std
    levels = np.unique(test.torque_Nm)
    means = np.array([test.current_A[test.torque_Nm == level].mean() for level in levels])
    at_levels = levels / (test.ideal_gain_Nm_per_A * means)
    panel.plot(levels, 100 * at_levels, "o", color=MEASURED, markersize=4, label="mean at each torque")
    panel.fill_between(line, 100 * low, 100 * high, color=FITTED, alpha=0.2, linewidth=0, label="90 %")
    panel.plot(line, 100 * share, color=FITTED, label="fitted")
    panel.set_ylabel("efficiency, including no-load current [%]")
    panel.set_ylim(bottom=0)


def plot_radius(
    path: Path, rolled: dict[int, tuple[Array, Array]], found: dict[int, RadiusFit], mean: RadiusFit
) -> None:
    """Write a figure of the wheels' speeds (time [s], speed at the wheel [rad/s]), their radii, and the mean radius."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.4), layout="constrained")
        left, right = figure.subplots(1, 2)
        for wheel, (time, speed) in sorted(rolled.items()):
            left.plot(time, speed, linewidth=0.8, label=f"wheel {wheel}")
        left.set_xlabel("time [s]")
        left.set_ylabel("wheel speed [rad/s]")
        left.set_title("the recording must include start and stop", loc="left")
        left.legend(frameon=False, fontsize=7, ncols=2)
        low, high = (1e3 * (mean.radius_m + side * STD_90 * mean.radius_std_m) for side in (-1, 1))
        right.axhspan(low, high, color=FITTED, alpha=0.2, linewidth=0)
        right.axhline(1e3 * mean.radius_m, color=FITTED, label="mean, as written; 90 %")
        wheels = sorted(found)
        values, deviations = (
            [1e3 * getattr(found[wheel], name) for wheel in wheels] for name in ("radius_m", "radius_std_m")
        )
        bars = STD_90 * np.array(deviations)
        right.errorbar(wheels, values, bars, fmt="o", color=MEASURED, capsize=3, label="each wheel; 90 %")
        right.set_xticks(wheels)
        right.set_xlabel("wheel")
        right.set_ylabel("radius [mm]")
        right.legend(frameon=False)
        _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
