"""The picture of the study: each trial's margin after the three experiments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, svg, text
from regolithd.calibration.validation.experiment_study.choices import CHOICES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.experiment_study.trials import Trial

STYLE = """<style>text{font:12px sans-serif;fill:#5c6570}.ground{fill:#f5f6f8}.axis{stroke:#d9dde2;fill:none}
.pair{fill:none;stroke:#c9d3dd;stroke-width:1}.right{fill:#23679b}.wrong{fill:#fff;stroke:#b5482a;stroke-width:1.6}
.zero{stroke:#b5482a;stroke-dasharray:3 3;fill:none}.paper{fill:#fff}</style>
<rect class="paper" width="560" height="330"/>"""


def picture(trials: Sequence[Trial]) -> str:
    """Return the margins as SVG: a column for each choice, a line for each trial, hollow where the name is wrong."""
    driven = [trial for trial in trials if trial.results]
    found = [trial.results[choice].margin for trial in driven for choice in CHOICES]
    low, high = min([0.0, *found]), max([1.0, *found])
    panel = Panel(70, 34, 380, 240, (-0.5, len(CHOICES) - 0.5), (1.05 * low, 1.05 * high))
    parts = [STYLE, box(panel), axes(panel, "", "Δχ² of the right name over the best other", x_about=1)]
    parts.append(line([(panel.left, panel.at_y(0.0)), (panel.left + panel.width, panel.at_y(0.0))], "zero"))
    for trial in driven:
        points = [(panel.at_x(place), panel.at_y(trial.results[choice].margin)) for place, choice in enumerate(CHOICES)]
        parts.append(line(points, "pair"))
        for (x, y), choice in zip(points, CHOICES, strict=True):
            kind = "right" if trial.results[choice].right else "wrong"
            parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="4"/>')
    parts += [
        text(panel.at_x(place), panel.top + panel.height + 34, choice, anchor="middle")
        for place, choice in enumerate(CHOICES)
    ]
    parts.append(text(panel.left, 20, "full: the right name alone; hollow: another answer"))
    return svg(560, 330, parts, "Margin of the right name after the proposed, a covariate-wise and a random experiment")
