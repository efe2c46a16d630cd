"""The picture of the study: which share of the drives has been reported so long after the onset."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, svg, text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.online_study.measured import Delay

LONGEST_MIN = 30.0
LEGEND_TOP, LEGEND_STEP = 0.42, 0.085
LEGEND_LINE = (19.0, 21.5)
"""The legend, where no curve is: shares of the height, and minutes."""
STYLE = """<style>text{font:12px sans-serif;fill:#333}.ground{fill:#fff;stroke:#bbb}.grid,.tick{stroke:#ddd}
.curve{fill:none;stroke:#1f5fa8;stroke-width:2}
.size0{stroke:#8fb8de;stroke-dasharray:2 3}.size1{stroke:#6a9fd0;stroke-dasharray:7 3}.size2{stroke:#3f7fc0}
.size3{stroke:#1f5fa8;stroke-dasharray:9 3 2 3}.size4{stroke:#0d2f5e;stroke-width:2.6}</style>"""


def picture(delays: Sequence[Delay], shares: Sequence[float]) -> str:
    """Draw the share of drives that are reported over the time since the onset, a curve for each size."""
    panel = Panel(62, 26, 560, 220, (0.0, LONGEST_MIN), (0.0, 1.0))
    parts = [
        STYLE,
        box(panel),
        axes(panel, "time since the drag began (min)", ""),
        text(panel.left, 16, "share of drives reported"),
    ]
    for place, share in enumerate(shares):
        times = sorted(each.delay_s / 60 for each in delays if each.share == share and each.delay_s is not None)
        count = sum(each.share == share for each in delays)
        points, level = [(0.0, 0.0)], 0.0
        for time in times:
            if time > LONGEST_MIN:
                break
            points += [(time, level), (time, level + 1 / count)]
            level += 1 / count
        points.append((LONGEST_MIN, level))
        parts.append(line([(panel.at_x(x), panel.at_y(y)) for x, y in points], f"curve size{place}"))
        row = panel.at_y(LEGEND_TOP - LEGEND_STEP * place)
        parts.append(line([(panel.at_x(x), row) for x in LEGEND_LINE], f"curve size{place}"))
        parts.append(text(panel.at_x(LEGEND_LINE[1]) + 8, row + 4, f"{100 * share:.0f} % of the mean current"))
    return svg(660, 300, parts, "Delay of the report of drag on one wheel, by its size relative to the mean current")
