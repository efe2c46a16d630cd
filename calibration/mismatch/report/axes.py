"""Scales, ticks and marks as inline SVG; colours come from the page's classes."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.rounding import GREATEST_PLAIN, LEAST_PLAIN, with_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

MINUS = "−"
"""U+2212, which is as wide as a plus sign."""


@dataclass(frozen=True)
class Panel:
    """A rectangle of the drawing [px] and the ranges that it shows; y grows upwards."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    def at_x(self, value: float) -> float:
        """Return where a value is across."""
        return self.left + self.width * (value - self.x[0]) / ((self.x[1] - self.x[0]) or 1.0)

    def at_y(self, value: float) -> float:
        """Return where a value is down."""
        return self.top + self.height * (1 - (value - self.y[0]) / ((self.y[1] - self.y[0]) or 1.0))


def ticks(low: float, high: float, about: int = 5) -> list[float]:
    """Return about `about` round numbers between two values: multiples of 1, 2, 2.5 or 5 times a power of ten."""
    span = high - low
    if about == 0:
        return []
    if not np.isfinite(span) or span <= 0:
        return [low]
    raw = span / about
    scale = 10.0 ** np.floor(np.log10(raw))
    step = scale * next(m for m in (1, 2, 2.5, 5, 10) if m * scale >= raw * 0.999)
    first = np.ceil(low / step - 1e-9)
    return [float(round(k * step, 12)) + 0.0 for k in np.arange(first, np.floor(high / step + 1e-9) + 1)]


def number(value: float, digits: int = 3) -> str:
    """Return a number with a minus sign (U+2212), and without an exponent from 1e-5 to 1e7."""
    if not np.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    if "e" in text and LEAST_PLAIN <= abs(value) < GREATEST_PLAIN:
        text = np.format_float_positional(float(text), trim="-")
    return text.replace("-", MINUS)


def interval(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a value and its interval with a minus sign (U+2212), and as many places as the interval supports."""
    if not np.isfinite(high - low):
        return number(value), number(low), number(high)
    value_text, low_text, high_text = (each.replace("-", MINUS) for each in with_interval(value, low, high))
    return value_text, low_text, high_text


def text(x: float, y: float, words: str, *, anchor: str = "start", kind: str = "", turn: float = 0.0) -> str:
    """Return a text element."""
    turned = f' transform="rotate({turn} {x:.1f} {y:.1f})"' if turn else ""
    named = f' class="{kind}"' if kind else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{named}{turned}>{escape(words)}</text>'


def line(points: Sequence[tuple[float, float]], kind: str) -> str:
    """Return a polyline; broken where a point is not finite."""
    parts, pen = [], "M"
    for x, y in points:
        if np.isfinite(x) and np.isfinite(y):
            parts.append(f"{pen}{x:.1f} {y:.1f}")
            pen = "L"
        else:
            pen = "M"
    return f'<path class="{kind}" d="{" ".join(parts)}"/>'


def box(panel: Panel, kind: str = "ground") -> str:
    """Return the panel's background."""
    return (
        f'<rect class="{kind}" x="{panel.left:.1f}" y="{panel.top:.1f}" '
        f'width="{panel.width:.1f}" height="{panel.height:.1f}"/>'
    )


def axes(panel: Panel, x_label: str, y_label: str, *, x_about: int = 6, y_about: int = 4) -> str:
    """Return ticks, numbers and labels on the left and below."""
    bottom = panel.top + panel.height
    parts = []
    for value in ticks(*panel.x, x_about):
        at = panel.at_x(value)
        parts += [line([(at, bottom), (at, bottom + 4)], "axis"), text(at, bottom + 17, number(value), anchor="middle")]
    for value in ticks(*panel.y, y_about):
        at = panel.at_y(value)
        parts += [line([(panel.left - 4, at), (panel.left, at)], "axis")]
        parts += [text(panel.left - 7, at + 4, number(value), anchor="end")]
    parts.append(text(panel.left + panel.width / 2, bottom + 35, x_label, anchor="middle"))
    if y_label:
        middle = panel.top + panel.height / 2
        parts.append(text(panel.left - 66, middle, y_label, anchor="middle", turn=-90))
    return "".join(parts)


def svg(width: float, height: float, parts: Sequence[str], label: str) -> str:
    """Return the drawing, with `label` for screen readers."""
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{escape(label)}" '
        f'xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'
    )
