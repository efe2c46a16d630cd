"""The picture of the study: which share of the drives has been reported so long after the onset."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, svg, text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.online_study.measured import Delay

LONGEST_MIN = 30.0
STYLE = """<style>text{font:12px sans-serif;fill:#333}.ground{fill:#fff;stroke:#bbb}.grid,.tick{stroke:#ddd}
.curve{fill:none;stroke:#1f5fa8;stroke-width:2}</style>"""


def picture(delays: Sequence[Delay], shares: Sequence[float]) -> str:
    """Draw the share of drives that are reported over the time since the onset, a curve for each size."""
    panel = Panel(62, 26, 560, 220, (0.0, LONGEST_MIN), (0.0, 1.0))
    parts = [
        STYLE,
        box(panel),
        axes(panel, "time since the drag began (min)", ""),
        text(panel.left, 16, "share of drives reported"),
    ]
    for share in shares:
        times = sorted(each.delay_s / 60 for each in delays if each.share == share and each.delay_s is not None)
        count = sum(each.share == share for each in delays)
        points, level = [(0.0, 0.0)], 0.0
        for time in times:
            if time > LONGEST_MIN:
                break
            points += [(time, level), (time, level + 1 / count)]
            level += 1 / count
        points.append((LONGEST_MIN, level))
        parts.append(line([(panel.at_x(x), panel.at_y(y)) for x, y in points], "curve"))
        middle = np.interp(0.5 * level, [y for _, y in points], [x for x, _ in points])
        parts.append(text(panel.at_x(float(middle)) + 4, panel.at_y(0.5 * level) + 12, f"{100 * share:.0f} %"))
    return svg(660, 300, parts, "Delay of the report of drag on one wheel, by its size relative to the mean current")
