"""When each axle crossed the border, and when the alarm came, from estimates and ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.daemon.demo.ground_truth_log import Record

AXLES = {"front": 0, "middle": 2, "rear": 4}
"""Axle → index of its left wheel."""


@dataclass(frozen=True, slots=True)
class Crossings:
    """Seconds of the live part at which each axle entered the second soil, and at which the alarm was raised."""

    axles: dict[str, float]
    alarm_s: float | None

    @property
    def lines(self) -> list[str]:
        """The result in sentences."""
        found = [f"{axle} axle on the weak soil from {at:.1f} s" for axle, at in self.axles.items()]
        if self.alarm_s is None:
            return [*found, "no soil-change alarm in this drive"]
        text = f"soil-change alarm at {self.alarm_s:.1f} s"
        if (rear := self.axles.get("rear")) is not None:
            before = rear - self.alarm_s
            text += f", {abs(before):.1f} s {'before' if before > 0 else 'after'} the rear axle"
        return [*found, text]


def crossings(records: list[Record], live_from_ns: int) -> Crossings:
    """Return the crossings and the first alarm of the live part."""
    axles: dict[str, float] = {}
    alarm: float | None = None
    first = records[0][1].soils[0]
    for estimate, truth in records:
        at = (estimate.snapshot.time_ns - live_from_ns) / 1e9
        if at < 0:
            continue
        for axle, wheel in AXLES.items():
            if truth.soils[wheel] != first:
                axles.setdefault(axle, at)
        if estimate.soil_change is not None and alarm is None:
            alarm = at
    return Crossings(axles, alarm)
