"""The report's part about an empirical curve: the curve with its band, and the closed forms that are suggested."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from regolithd.calibration.mismatch.inference.statements import NO_HELP, capital
from regolithd.calibration.mismatch.report.axes import Panel, axes, box, interval, line, number, svg, text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import EmpiricalFit, Evidence, Parameter, Suggestion, Unexplained
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve
    from regolithd.calibration.mismatch.report.axes import Array
    from regolithd.calibration.mismatch.report.labels import Labels

WIDTH, HEIGHT = 800.0, 270.0
"""Size of the drawing [px]."""
LONGEST_BAR = 4.0
"""Length of an error bar, in that of the median one, beyond which it is cut at the edge (a choice: the curve shows)."""
ACTS = {
    "offset": "It is added to the prediction.",
    "drag": "It acts against the motion: times the sign of the speed.",
    "gain": "It is a share of the prediction.",
    "each way": "It is added to the prediction; the speed has its sign.",
}
"""How a curve acts, by its coupling; others are drags that act oppositely on two parts of the machine."""


@dataclass(frozen=True)
class SuggestedRow:
    """A closed form as texts."""

    equation: str
    parameters: str
    error: str


@dataclass(frozen=True)
class EmpiricalSection:
    """A curve: its drawing, how it acts, the held-out errors without and with it, a caution, and the suggestions."""

    svg: Markup
    acts: str
    before: str
    after: str
    unit: str
    caution: str
    forms: tuple[SuggestedRow, ...]


def empirical_section(place: Unexplained, evidence: Evidence, labels: Labels) -> EmpiricalSection:
    """Return the part about the curve of what is unexplained, which it must have."""
    curve = place.curve
    assert curve is not None  # noqa: S101  # the caller looked
    fit = next((each for each in evidence.empirical if each.curve.curve is curve), None)
    factor, unit = labels.scaled(evidence.unit)
    parts = curve.coupling.removeprefix("drag, ")
    return EmpiricalSection(
        svg=Markup(band_figure(place.covariate, curve, fit, labels)),  # noqa: S704  # escaped inside
        acts=ACTS.get(curve.coupling, f"It acts against the motion, with one sign and the other on {parts}."),
        before=number(factor * curve.held_out_rmse_before),
        after=number(factor * curve.held_out_rmse_after),
        unit=unit,
        caution="" if curve.helps_held_out else capital(NO_HELP),
        forms=tuple(_row(each, factor) for each in place.suggestions),
    )


def _row(form: Suggestion, factor: float) -> SuggestedRow:
    told = "; ".join(_with_name(name, one) for name, one in form.parameters.items())
    return SuggestedRow(form.equation, told, number(factor * form.held_out_rmse))


def _with_name(name: str, parameter: Parameter) -> str:
    """Return a parameter of a closed form with its interval: "a = 19.20 (18.97 … 19.41) mm"."""
    value, low, high = interval(parameter.value, parameter.low, parameter.high)
    return f"{name} = {value} ({low} … {high}) {'' if parameter.unit == '1' else parameter.unit}".strip()


def band_figure(covariate: str, curve: EmpiricalCurve, fit: EmpiricalFit | None, labels: Labels) -> str:
    """Draw a curve with its band over its range; of a fit, the points that it goes through and the first suggestion."""
    factor, unit = labels.scaled(curve.unit)
    at = np.array(curve.at) * (labels.time_factor if covariate == "time" else 1.0)
    value, low, high = (factor * np.array(row) for row in (curve.value, curve.low, curve.high))
    points = _Points.of(fit, at, factor, labels.time_factor if covariate == "time" else 1.0)
    known = points.known
    ends = (min(0.0, float(low.min()), *points.low[known]), max(0.0, float(high.max()), *points.high[known]))
    margin = 0.08 * ((ends[1] - ends[0]) or 1.0)
    panel = Panel(84, 12, WIDTH - 96, HEIGHT - 62, (float(at[0]), float(at[-1])), (ends[0] - margin, ends[1] + margin))
    parts = [box(panel), _band(panel, at, low, high)]
    parts.append(line([(panel.left, panel.at_y(0)), (panel.left + panel.width, panel.at_y(0))], "zero"))
    for x, bottom, top in zip(points.at, points.low, points.high, strict=True):
        across_at, mean = panel.at_x(x), (bottom + top) / 2
        bar = (panel.at_y(each) for each in np.clip((bottom, top), *panel.y))
        parts.append(line([(across_at, each) for each in bar], "before bar"))
        if panel.y[0] <= mean <= panel.y[1]:
            parts.append(f'<circle class="before" cx="{across_at:.1f}" cy="{panel.at_y(mean):.1f}" r="2.6"/>')
    parts.append(line([(panel.at_x(x), panel.at_y(y)) for x, y in zip(at, value, strict=True)], "before line"))
    if fit is not None and fit.suggested.size:
        broken = zip(at, factor * fit.suggested, strict=True)
        parts.append(line([(panel.at_x(x), panel.at_y(y)) for x, y in broken], "after line suggested"))
    across = f"|{labels.axis(covariate)}|" if curve.magnitude else labels.axis(covariate)
    parts.append(axes(panel, across, f"curve ({unit})" if unit else "curve (share)", x_about=7, y_about=5))
    parts.append(text(panel.left + 8, panel.top + 16, "empirical curve, 90 % band"))
    return svg(WIDTH, HEIGHT, parts, f"Empirical curve over {across} with its 90 % band")


@dataclass(frozen=True, eq=False)
class _Points:
    """Points with the ends of their bars, inside the curve's range."""

    at: Array
    low: Array
    high: Array

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which are known well enough to be shown whole: no bar is much longer than that of the others."""
        bars = self.high - self.low
        return np.asarray(bars <= LONGEST_BAR * np.median(bars)) if bars.size else np.zeros(0, np.bool_)

    @classmethod
    def of(cls, fit: EmpiricalFit | None, knots: Array, factor: float, time_factor: float) -> _Points:
        if fit is None:
            return cls(np.zeros(0), np.zeros(0), np.zeros(0))
        at = time_factor * fit.at
        inside = (at >= knots[0]) & (at <= knots[-1])
        mean, bar = factor * fit.mean[inside], 2 * factor * fit.standard_error[inside]
        return cls(at[inside], mean - bar, mean + bar)


def _band(panel: Panel, at: Array, low: Array, high: Array) -> str:
    """Return the area between two courses."""
    there = [(panel.at_x(x), panel.at_y(y)) for x, y in zip(at, high, strict=True)]
    back = [(panel.at_x(x), panel.at_y(y)) for x, y in zip(at[::-1], low[::-1], strict=True)]
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in (*there, *back))
    return f'<polygon class="noise" points="{corners}"/>'
