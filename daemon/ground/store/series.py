"""The numbers that are drawn against time, taken from the messages, and their means over spans of time.

A series is one channel's numbers, in a fixed order. A bucket holds, for one span of time and one session, the number of
values and their sum for each: the order in which messages arrive does not change it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

SPANS_S = (2, 15, 120, 900)
"""Spans of the buckets. A plot takes the shortest that gives at most `MOST_POINTS`."""
MOST_POINTS = 2500

WHEEL_QUANTITIES = ("load_N", "slip", "smoothed_torque_Nm", "motor_current_A")
POSTERIOR_QUANTITIES = ("cohesion_Pa", "friction_angle_rad", "drawbar_margin")
LEVELS = ("low_90", "low_50", "median", "high_50", "high_90")
POSE = ("x_m", "y_m", "heading_rad", "distance_m", "speed_m_s")


@dataclass(frozen=True, slots=True)
class Series:
    """A channel whose numbers are drawn, their names in order, and the function that takes them from a message."""

    channel: str
    names: tuple[str, ...]
    values: Callable[[dict[str, Any]], list[float]]


def _number(value: Any) -> float:  # noqa: ANN401  # any JSON value
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan


def _of_wheels(content: dict[str, Any]) -> list[float]:
    six = [None] * 6
    return [_number(value) for name in WHEEL_QUANTITIES for value in (content.get(name) or six)[:6]]


def _of_posterior(content: dict[str, Any]) -> list[float]:
    return [_number((content.get(name) or {}).get(level)) for name in POSTERIOR_QUANTITIES for level in LEVELS]


def _of_pose(content: dict[str, Any]) -> list[float]:
    return [_number(content.get(name)) for name in POSE]


SERIES = {
    series.channel: series
    for series in (
        Series("snapshot", tuple(f"{name}_{wheel}" for name in WHEEL_QUANTITIES for wheel in range(1, 7)), _of_wheels),
        Series(
            "posterior", tuple(f"{name}_{level}" for name in POSTERIOR_QUANTITIES for level in LEVELS), _of_posterior
        ),
        Series("odometry", POSE, _of_pose),
    )
}


@dataclass(frozen=True, slots=True, eq=False)
class Bucket:
    """Number and sum of the values in a span, shape (2, names), and the number of late messages among them."""

    sums: Array
    late: int

    @classmethod
    def empty(cls, series: Series) -> Bucket:
        """Return a bucket without values."""
        return cls(np.zeros((2, len(series.names))), 0)

    @classmethod
    def from_bytes(cls, sums: bytes, late: int) -> Bucket:
        """Return what `sums.tobytes()` was made from."""
        return cls(np.frombuffer(sums).reshape(2, -1), late)

    def add(self, values: Array, *, late: bool) -> Bucket:
        """Return the bucket with one message more; NaN is left out."""
        known = np.isfinite(values)
        return Bucket(self.sums + np.stack([known, np.where(known, values, 0.0)]), self.late + late)

    @property
    def mean(self) -> Array:
        """The means, shape (names,); NaN where there is no value."""
        count, total = self.sums
        return np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
