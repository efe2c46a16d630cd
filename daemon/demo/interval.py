"""An interval as a line of text: what is 90 % sure, what is 50 % sure, and the median."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Mapping

WIDTH = 34


@dataclass(frozen=True, slots=True)
class Scale:
    """What is shown, in which unit (SI × `factor`), from where to where, with how many digits."""

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


def interval_line(scale: Scale, interval: Mapping[str, Any]) -> Text:
    """Return label, bar and numbers; thin is the 90 % interval, thick the 50 %."""
    at = {name: float(value) * scale.factor for name, value in interval.items()}

    def column(value: float) -> int:
        share = (value - scale.low) / (scale.high - scale.low)
        return min(WIDTH - 1, max(0, round(share * (WIDTH - 1))))

    bar = [" "] * WIDTH
    for name, mark in (("90", "─"), ("50", "━")):
        for place in range(column(at[f"low_{name}"]), column(at[f"high_{name}"]) + 1):
            bar[place] = mark
    bar[column(at["median"])] = "●"
    numbers = f"{at['median']:.{scale.digits}f} {scale.unit}".rjust(8)
    between = f"{at['low_90']:.{scale.digits}f} … {at['high_90']:.{scale.digits}f}"
    return Text.assemble(
        (f"{scale.label:17}", "dim"), ("│", "dim"), ("".join(bar), "bold magenta"), ("│", "dim"), numbers, "  ", between
    )
