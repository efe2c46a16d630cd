"""The picture of the study: each trial's margin after the three experiments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, number, svg, text
from regolithd.calibration.validation.experiment_study.choices import CHOICES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.experiment_study.trials import Trial

STYLE = """<style>text{font:12px sans-serif;fill:#5c6570}.ground{fill:#f5f6f8}.axis{stroke:#d9dde2;fill:none}
.pair{fill:none;stroke:#c9d3dd;stroke-width:1}.right{fill:#23679b}.wrong{fill:#fff;stroke:#b5482a;stroke-width:1.6}
.zero{stroke:#b5482a;stroke-dasharray:3 3;fill:none}.paper{fill:#fff}</style>
<rect class="paper" width="560" height="310"/>"""


TICKS = (-100.0, -10.0, 0.0, 10.0, 100.0, 1000.0, 10000.0)
LINEAR_TO = 3.0
"""Margins up to about this size are drawn linearly, larger ones logarithmically."""


def at_scale(margin: float) -> float:
    """Return where a margin of either sign is on an axis that is logarithmic but near 0."""
    return float(np.arcsinh(margin / LINEAR_TO))


def picture(trials: Sequence[Trial]) -> str:
    """Return the margins as SVG: a column for each choice, a line for each trial, hollow where the name is wrong."""
    driven = [trial for trial in trials if trial.results]
    found = [at_scale(trial.results[choice].margin) for trial in driven for choice in CHOICES]
    ends = min([-1.5, *found]) - 0.2, max([1.5, *found]) + 0.2
    panel = Panel(84, 34, 380, 240, (-0.5, len(CHOICES) - 0.5), ends)
    parts = [STYLE, box(panel), axes(panel, "", "Δχ² of the right name over the best other", x_about=0, y_about=0)]
    for tick in TICKS:
        if ends[0] <= at_scale(tick) <= ends[1]:
            at = panel.at_y(at_scale(tick))
            right = panel.left + panel.width if tick == 0 else panel.left
            parts.append(line([(panel.left - 4, at), (right, at)], "axis" if tick else "zero"))
            parts.append(text(panel.left - 7, at + 4, number(tick, 6), anchor="end"))
    for trial in driven:
        margins = [at_scale(trial.results[choice].margin) for choice in CHOICES]
        points = [(panel.at_x(place), panel.at_y(margin)) for place, margin in enumerate(margins)]
        parts.append(line(points, "pair"))
        for (x, y), choice in zip(points, CHOICES, strict=True):
            kind = "right" if trial.results[choice].right else "wrong"
            parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="4"/>')
    parts += [
        text(panel.at_x(place), panel.top + panel.height + 22, choice, anchor="middle")
        for place, choice in enumerate(CHOICES)
    ]
    parts.append(text(panel.left, 20, "full: the right name alone; hollow: another answer"))
    return svg(560, 310, parts, "Margin of the right name after the proposed, a covariate-wise and a random experiment")
