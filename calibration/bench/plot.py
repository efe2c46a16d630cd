"""What was measured and what was fitted, wheel by wheel."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pathlib import Path

Array = NDArray[np.float64]
Fit = tuple[Array, Array, Callable[[Array], Array]]
"""Measured x and y, and the fitted line."""


def draw(path: Path, wheels: dict[int, Fit], x_label: str, y_label: str) -> None:
    """Write one panel for each wheel: points, and the fitted line."""
    with mpl.rc_context({"svg.hashsalt": "regolithd", "font.size": 9}):
        figure = Figure(figsize=(9, 3 * -(-len(wheels) // 3)), layout="constrained")
        panels = figure.subplots(-(-len(wheels) // 3), min(3, len(wheels)), squeeze=False, sharex=True, sharey=True)
        for panel in panels.flat[len(wheels) :]:
            panel.set_visible(False)
        for panel, (wheel, (x, y, fit)) in zip(panels.flat, sorted(wheels.items()), strict=False):
            panel.plot(x, y, ".", color="#7f8c8d", markersize=2, alpha=0.6)
            line = np.linspace(x.min(), x.max(), 400)
            panel.plot(line, fit(line), color="#c0392b")
            panel.set_title(f"wheel {wheel}", loc="left")
            panel.spines[["top", "right"]].set_visible(False)
        figure.supxlabel(x_label)
        figure.supylabel(y_label)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150)
