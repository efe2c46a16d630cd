"""Figures of the reproduction for `docs/`, and the style that the figures of the evaluation share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from regolithd.calibration.paper.sizing import PAPER_MSE, PAPER_SIZE
from regolithd.calibration.parameters import SOILS
from regolithd.calibration.validation.reproduction import published
from regolithd.calibration.validation.reproduction.recomputation import ROVER_LOADS_N

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from regolithd.calibration.paper.training_set import TrainingSet
    from regolithd.calibration.validation.reproduction.recomputation import SyntheticTraverse

    Array = NDArray[np.float64]

PAPER, OURS, SOIL_COLOURS = "#7f8c8d", "#c0392b", ("#e0a030", "#8e5a2b", "#4a7ba6", "#5b8a4a")
SOIL_MARKERS = ("o", "s", "^", "D")
"""Each soil has a marker of its own as well: brown and green are one colour to many."""
STYLE: Any = {
    "font.size": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 12,
    "legend.frameon": False,
    "svg.hashsalt": "regolithd",
    "figure.facecolor": "white",
}


PLACE_STEP = 2.0**-20
"""Places in a figure are multiples of this fraction of it: far below a pixel, far above rounding errors."""
EVERY = 3
"""Every third record of a traverse is drawn; the mean is over all records."""


def figure(width: float, height: float) -> Figure:
    """Return an empty figure of this size [in]."""
    return Figure(figsize=(width, height), layout="constrained")


def save(made: Figure, path: Path, dpi: int = 150) -> None:
    """Write a figure; the same numbers give the same bytes."""
    _fix_layout(made)
    path.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Date": None} if path.suffix == ".svg" else {}
    made.savefig(path, dpi=dpi, metadata=metadata)


def _fix_layout(made: Figure) -> None:
    """Lay out the figure once and round the places of its panels.

    The solver of the constrained layout orders its variables by their addresses in memory, so that its last bits
    differ from call to call; an SVG's identifiers are hashes of these places.
    """
    made.draw_without_rendering()
    made.set_layout_engine("none")
    for part in made.subfigs:
        part.bbox_relative.set_points(_rounded(part.bbox_relative.get_points()))
    for panel in made.axes:
        panel.set_position(Bbox(_rounded(panel.get_position(original=True).get_points())))


def _rounded(places: Array) -> Array:
    return np.round(places / PLACE_STEP) * PLACE_STEP


def sizing(figures: Mapping[str, float], path: Path) -> None:
    """Draw the mean MSE of each size with its standard error, beside the paper's."""
    sizes = sorted(int(key.removeprefix("mean_mse_")) for key in figures if key.startswith("mean_mse_"))
    mean = [figures[f"mean_mse_{size}"] for size in sizes]
    error = [2 * figures[f"standard_error_{size}"] for size in sizes]
    with mpl.rc_context(STYLE):
        made = figure(9, 4)
        panel = made.subplots()
        panel.errorbar(
            sizes, mean, error, fmt="o", color=OURS, capsize=2, label="recomputed: mean of 100 trainings, ± 2 s.e."
        )
        panel.plot([PAPER_SIZE], [PAPER_MSE], "D", color=PAPER, markersize=9, label="the paper's best: 64, 0.0251")
        panel.set(xlabel="hidden neurons", ylabel="MSE (10 kPa, 1)", title="Mean MSE of 26 sizes, 26 million epochs")
        panel.legend()
        save(made, path)


def training_set(pairs: TrainingSet, path: Path) -> None:
    """Draw the pairs' loads against current, and the range of loads of a 30 kg rover."""
    with mpl.rc_context(STYLE):
        made = figure(9, 4.2)
        panel = made.subplots()
        panel.axhspan(*ROVER_LOADS_N, color="#27ae60", alpha=0.15, label="range for a 30 kg rover")
        for index, (name, colour, marker) in enumerate(zip(SOILS, SOIL_COLOURS, SOIL_MARKERS, strict=True)):
            mine = pairs.soil == index
            current_mA = 1e3 * pairs.inputs[mine, 2] + (index - 1.5) * 1.6
            style: dict[str, Any] = {"color": colour, "markersize": 3.5, "label": name}
            panel.plot(current_mA, pairs.inputs[mine, 0], marker, linestyle="none", **style)
        panel.set(yscale="log", xlabel="motor current (mA)", ylabel="load by Step 14 (N)")
        panel.set_title("Most of the 504 pairs have loads outside the range of a 30 kg rover")
        panel.legend(loc="upper left", bbox_to_anchor=(1, 1))
        save(made, path)


def traverse(traverses: Sequence[SyntheticTraverse], path: Path, wheel: int = 5) -> None:
    """Draw c and φ of one wheel along the synthetic traverse, as in the paper's Figs 6–9."""
    time = np.arange(published.RECORDS) / 2
    with mpl.rc_context(STYLE):
        made = figure(11, 6)
        panels = made.subplots(2, 2, sharex=True, sharey="row")
        for column, each in enumerate(traverses):
            for row, (values, published_mean, label) in enumerate(
                (
                    (each.cohesion_Pa / 1e3, published.COHESION_PA[each.ground][wheel - 1] / 1e3, "c (kPa)"),
                    (each.angle_deg, published.ANGLE_DEG[each.ground][wheel - 1], "φ (°)"),
                )
            ):
                _trace(panels[row, column], time, values[:, wheel - 1], published_mean, label if column == 0 else "")
            panels[0, column].set_title(f"{each.ground} ground, wheel {wheel}")
            panels[1, column].set_xlabel("time (s)")
        made.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
        save(made, path)


def _trace(panel: Axes, time: Array, values: Array, published_mean: float, label: str) -> None:
    shown = np.s_[::EVERY]
    panel.plot(time[shown], values[shown], color=OURS, linewidth=0.7, label="paper's network, synthetic traverse")
    panel.axhline(values.mean(), color=OURS, linestyle="--", label="its mean")
    panel.axhline(published_mean, color=PAPER, linewidth=2, label="the paper's mean")
    panel.set_ylabel(label)
