"""The picture of the study: F1 of localisation against the parameters' error, a dot for each case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, svg, text
from regolithd.calibration.validation.reliability import STYLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.region_study.score import Score

SHOWN = ("regolithd", "LISDD")
LARGEST_ERROR = 0.2
"""Right end of the axis; larger errors are drawn there."""


def picture(scores: Sequence[Score]) -> str:
    """Return one panel for each method as SVG."""
    parts = [STYLE]
    for place, method in enumerate(SHOWN):
        panel = Panel(left=80 + 350 * place, top=36, width=270, height=220, x=(0.0, LARGEST_ERROR), y=(0.0, 1.0))
        own = [score for score in scores if score.method == method]
        parts += [box(panel), axes(panel, "mean relative error of the parameters", "F1 of the failing rows")]
        parts.append(text(panel.left, panel.top - 12, method))
        for score in own:
            error = min(float(np.mean(np.abs(score.errors))), LARGEST_ERROR)
            parts.append(f'<circle class="dot" cx="{panel.at_x(error):.1f}" cy="{panel.at_y(score.f1):.1f}" r="3.5"/>')
    return svg(720, 316, parts, "F1 of localisation against the error of the parameters, regolithd and LISDD")
