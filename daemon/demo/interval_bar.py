"""A posterior's interval as one line of text: a bar with 90 % interval, 50 % interval and median."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Mapping

WIDTH = 34


@dataclass(frozen=True, slots=True)
class Scale:
    """A quantity of the posterior message, its displayed unit (SI × `factor`), axis limits and number of digits."""

    key: str
    label: str
    unit: str
    factor: float
    low: float
    high: float
    digits: int


SCALES = (
    Scale("cohesion_Pa", "cohesion c", "kPa", 1e-3, 0.0, 10.0, 1),
    Scale("friction_angle_rad", "friction angle φ", "°", 57.29577951308232, 0.0, 45.0, 0),
    Scale("drawbar_margin", "drawbar margin", "%", 100.0, -20.0, 80.0, 0),
)


def interval_bar(scale: Scale, interval: Mapping[str, Any]) -> Text:
    """Return label, bar and numbers; the thin line is the 90 % interval, the thick one the 50 % interval."""
    shown = {name: float(value) * scale.factor for name, value in interval.items()}

    def column(value: float) -> int:
        share = (value - scale.low) / (scale.high - scale.low)
        return min(WIDTH - 1, max(0, round(share * (WIDTH - 1))))

    bar = [" "] * WIDTH
    for name, mark in (("90", "─"), ("50", "━")):
        for place in range(column(shown[f"low_{name}"]), column(shown[f"high_{name}"]) + 1):
            bar[place] = mark
    bar[column(shown["median"])] = "●"
    numbers = f"{shown['median']:.{scale.digits}f} {scale.unit}".rjust(8)
    between = f"{shown['low_90']:.{scale.digits}f} … {shown['high_90']:.{scale.digits}f}"
    return Text.assemble(
        (f"{scale.label:17}", "dim"), ("│", "dim"), ("".join(bar), "bold magenta"), ("│", "dim"), numbers, "  ", between
    )
