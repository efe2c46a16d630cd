"""The report's drawings: residual over wheels and time, residual against a covariate, held-out error, intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.inference.statements import noun_before
from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, number, svg, text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Answer, Curve, Evidence
    from regolithd.calibration.mismatch.report.axes import Array
    from regolithd.calibration.mismatch.report.labels import Labels

WIDTH = 800.0
"""Of a drawing over the page's whole width [px]."""
FULL_COLOUR = 6.0
"""Standard errors at which a cell has its full colour (a choice: twice what noise seldom passes)."""
LONGEST_BAR = 3.0
"""Error bars up to so many times the median one set the scale (a choice: of a bin with few readings it is cut off)."""
OPACITY_POWER = 1.2
"""Opacity goes with this power of the standard errors, so that noise stays pale (a choice)."""
FAINTEST = 0.02
"""Opacity below which a cell is not drawn: it could not be seen."""

COUPLINGS = {"drag": "residual × sign of speed", "gain": "residual × sign of prediction", "offset": "residual"}
"""What the vertical axis of a curve shows, by the curve's coupling."""


def map_figure(answer: Answer, evidence: Evidence, labels: Labels) -> str:
    """Draw each wheel's residual over time in standard errors, before and after the effects."""
    edges = _edges(evidence.map_time_s * labels.time_factor)
    rows = len(evidence.wheels)
    high, left, gap = 18.0, 84.0, 40.0
    wide = WIDTH - left - 12
    headings = ("calibrated simulation", "with the effects added")[: 2 if answer.effects or answer.changes else 1]
    tops = [26.0 + k * (high * rows + gap) for k in range(len(headings))]
    panels = [Panel(left, top, wide, high * rows, (edges[0], edges[-1]), (0, rows)) for top in tops]
    parts: list[str] = []
    for panel, values, heading in zip(panels, (evidence.map_before, evidence.map_after), headings, strict=False):
        parts += [text(left, panel.top - 9, heading, kind="strong"), box(panel)]
        parts += _cells(panel, edges, values)
        for row, wheel in enumerate(evidence.wheels):
            label = f"{noun_before([wheel], labels.wheel)}{wheel}" if rows > 1 else "residual"
            parts.append(text(left - 9, panel.top + high * (row + 0.5) + 4, label, anchor="end"))
    parts += _onsets(answer, panels, labels)
    last = panels[-1]
    below = Panel(last.left, last.top, last.width, last.height, last.x, (0, 0))
    parts += [axes(below, labels.axis("time"), "", y_about=0), *_colour_key(left + wide - 310, 8)]
    return svg(
        WIDTH, last.top + last.height + 44, parts, f"Residual of each {labels.wheel} over time, before and after"
    )


def _onsets(answer: Answer, panels: Sequence[Panel], labels: Labels) -> list[str]:
    """Return a line through all panels and its label for each effect that begins at some time."""
    parts = []
    for effect in answer.effects:
        if effect.onset_s is not None:
            onset = effect.onset_s * labels.time_factor
            at, below = panels[0].at_x(onset), panels[0].top + panels[0].height + 15
            parts += [line([(at, p.top - 4), (at, p.top + p.height + 4)], "onset") for p in panels]
            parts.append(
                text(at + 5, below, f"onset {onset:.{2 if labels.time_unit == 'h' else 1}f} {labels.time_unit}")
            )
    return parts


def _edges(centres: Array) -> Array:
    """Return the borders of bins from their centres."""
    if len(centres) < 2:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    middles = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - middles[0]], middles, [2 * centres[-1] - middles[-1]]])


def _cells(panel: Panel, edges: Array, values: Array) -> list[str]:
    """Return one rectangle for each block and wheel, its opacity growing with the standard errors."""
    parts = []
    rows = values.shape[1]
    high = panel.height / rows
    for block, wheel in np.argwhere(np.isfinite(values)):
        x0, x1 = panel.at_x(edges[block]), panel.at_x(edges[block + 1])
        z = float(values[block, wheel])
        opacity = min(abs(z) / FULL_COLOUR, 1.0) ** OPACITY_POWER
        if opacity < FAINTEST:
            continue
        parts.append(
            f'<rect class="{"more" if z > 0 else "less"}" fill-opacity="{opacity:.2f}" x="{x0:.1f}" '
            f'y="{panel.top + wheel * high + 0.5:.1f}" width="{max(x1 - x0 - 0.4, 0.3):.1f}" height="{high - 1:.1f}"/>'
        )
    return parts


def _colour_key(left: float, top: float) -> list[str]:
    """Return the key of the colours, in standard errors."""
    parts = [text(left - 6, top + 10, "measured below simulated", anchor="end")]
    for step in range(-6, 7):
        kind, opacity = ("more" if step > 0 else "less"), (abs(step) / FULL_COLOUR) ** OPACITY_POWER
        x = left + 10 * (step + 6)
        parts.append(f'<rect class="ground" x="{x:.1f}" y="{top}" width="10" height="11"/>')
        parts.append(
            f'<rect class="{kind}" fill-opacity="{opacity:.2f}" x="{x:.1f}" y="{top}" width="10" height="11"/>'
        )
    parts.append(text(left + 138, top + 10, "above (±6 standard errors)"))
    return parts


def curve_figure(
    curve: Curve, unit: str, labels: Labels, *, corrected: bool = True, width: float = WIDTH, height: float = 270.0
) -> str:
    """Draw the residual against a covariate: before with its error bars, and after, if it was corrected."""
    factor, shown = labels.scaled(unit)
    small = width < 500
    centre = curve.at * labels.time_factor if curve.covariate == "time" else curve.at
    across = labels.axis(curve.covariate)
    before, after, spread = factor * curve.before, factor * curve.after, 2 * factor * curve.standard_error
    known = np.isfinite(before)
    if not known.any():
        return ""
    reach = np.minimum(spread, LONGEST_BAR * np.nanmedian(spread[known]))
    low = float(np.nanmin(np.concatenate([before - reach, after, [0.0]])))
    high = float(np.nanmax(np.concatenate([before + reach, after, [0.0]])))
    margin = 0.08 * ((high - low) or 1.0)
    ends = (float(np.min(centre)), float(np.max(centre)))
    air = 0.03 * ((ends[1] - ends[0]) or 1.0)
    left = 62.0 if small else 84.0
    panel = Panel(
        left, 12, width - left - 12, height - 62, (ends[0] - air, ends[1] + air), (low - margin, high + margin)
    )
    label = "" if small else f"{COUPLINGS.get(curve.coupling, curve.coupling)} ({shown})"
    parts = [box(panel), line([(panel.left, panel.at_y(0)), (panel.left + panel.width, panel.at_y(0))], "zero")]
    for x, y, e in zip(centre[known], before[known], spread[known], strict=True):
        at = panel.at_x(x)
        ends_of_bar = np.clip((y - e, y + e), *panel.y).tolist()
        parts.append(line([(at, panel.at_y(end)) for end in ends_of_bar], "before bar"))
    radius = 2.2 if small else 3.4
    for kind, values in (("before", before), ("after", after))[: 2 if corrected else 1]:
        xy = [(panel.at_x(x), panel.at_y(y)) for x, y in zip(centre, values, strict=True)]
        parts.append(line(xy, f"{kind} line"))
        parts += [
            f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{radius}"/>' for x, y in xy if np.isfinite(x + y)
        ]
    parts.append(axes(panel, across, label, x_about=4 if small else 7, y_about=3 if small else 5))
    return svg(width, height, parts, f"Residual against {across}, before and after")


def fit_figure(answer: Answer, unit: str, labels: Labels) -> str:
    """Draw the held-out error before and after, over the noise floor."""
    factor, shown = labels.scaled(unit)
    fit = answer.fit
    before, after, floor = (
        factor * value for value in (fit.held_out_rmse_before, fit.held_out_rmse_after, fit.noise_floor_rmse)
    )
    values = [value for value in (before, after, floor) if np.isfinite(value)]
    panel = Panel(84, 30, WIDTH - 84 - 40, 62, (0.0, 1.12 * max(values, default=1.0)), (0, 1))
    parts = [box(panel)]
    if np.isfinite(floor):
        wide = panel.at_x(floor) - panel.left
        parts.append(
            f'<rect class="noise" x="{panel.left}" y="{panel.top}" width="{wide:.1f}" height="{panel.height}"/>'
        )
        parts.append(text(panel.left + 8, panel.top + 16, f"noise floor {number(floor)} {shown}"))
    for kind, value, y in (("before", before, 0.36), ("after", after, 0.14)):
        if not np.isfinite(value):
            continue
        at, down = panel.at_x(value), panel.at_y(y)
        parts.append(f'<circle class="{kind}" cx="{at:.1f}" cy="{down:.1f}" r="5"/>')
        parts.append(line([(panel.left, down), (at, down)], f"{kind} bar"))
        parts.append(text(panel.left - 9, down + 4, kind, anchor="end"))
        parts.append(text(at + 10, down + 4, f"{number(value)}", kind="strong"))
    parts.append(axes(panel, f"held-out root-mean-square error ({shown})", "", y_about=0))
    return svg(WIDTH, 140, parts, "Held-out error before and after, and the noise floor")


def interval_figure(value: float, low: float, high: float) -> str:
    """Draw a value and its 90 % interval on a line that starts at zero: small enough for a table's cell."""
    ends = (min(0.0, low), max(0.0, high))
    panel = Panel(2, 2, 136, 12, ends, (0, 1))
    parts = [line([(panel.at_x(0), 1), (panel.at_x(0), 15)], "axis"), line([(2, 8), (138, 8)], "axis")]
    parts.append(line([(panel.at_x(low), 8), (panel.at_x(high), 8)], "before line"))
    parts.append(f'<circle class="before" cx="{panel.at_x(value):.1f}" cy="8" r="3.2"/>')
    drawing = svg(140, 16, parts, "value and interval")
    return drawing.replace("<svg ", '<svg class="interval" ', 1)
