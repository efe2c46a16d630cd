"""Detects a stuck sensor: its node answers and its value is in range, but the value no longer changes.

While a wheel turns, the noise of a sensor is larger than its resolution. A reading that stays exactly equal for
`STUCK_NS`, while those of at least `CHANGING_WHEELS` other wheels change, is stuck. Wheels that stand still are not
judged, and neither are readings that are constant on all wheels, as those of a simulation without noise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.pipeline.snapshot import ROW, WHEELS, Snapshot
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Quantity

QUANTITIES_CHECKED = tuple(quantity for quantity in QUANTITIES if quantity.noisy)
STUCK_NS = 5_000_000_000
STUCK_SNAPSHOTS = 20
"""Both must have passed: a slow converter repeats values at a fast SYNC, and a few equal readings occur by chance."""
CHANGING_WHEELS = 3
"""Number of other wheels whose readings must have changed in the same time."""


class StuckSensorDetector:
    """Takes every snapshot; `stuck` lists the sensors that are stuck."""

    def __init__(self) -> None:
        self._rows = [ROW[quantity] for quantity in QUANTITIES_CHECKED]
        self._last = np.full((len(QUANTITIES_CHECKED), WHEELS), np.nan)
        self._repeats = np.zeros((len(QUANTITIES_CHECKED), WHEELS), np.int64)
        self._since_ns = np.zeros((len(QUANTITIES_CHECKED), WHEELS), np.int64)
        self._now_ns = 0

    def step(self, snapshot: Snapshot) -> None:
        """Take one more snapshot; the count of a wheel that stands still, or is not measured, starts again at zero."""
        values = snapshot.values[self._rows]
        same = (values == self._last) & (np.abs(snapshot.motor_speed_rad_s) > 0)
        self._repeats = np.where(same, self._repeats + 1, 0)
        self._since_ns = np.where(same, self._since_ns, snapshot.time_ns)
        self._last = values
        self._now_ns = snapshot.time_ns

    @property
    def stuck(self) -> tuple[tuple[Quantity, int], ...]:
        """The stuck sensors: quantity and wheel (1–6)."""
        if not self._repeats.any():
            return ()
        lasting = (self._repeats >= STUCK_SNAPSHOTS) & (self._now_ns - self._since_ns >= STUCK_NS)
        measured = np.isfinite(self._last)
        found = []
        for quantity, long, there in zip(QUANTITIES_CHECKED, lasting, measured, strict=True):
            if np.sum(there & ~long) >= CHANGING_WHEELS:
                found += [(quantity, int(wheel) + 1) for wheel in np.flatnonzero(long)]
        return tuple(found)
