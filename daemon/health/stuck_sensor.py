"""Notices a sensor that repeats itself: its node answers, its value is in range, and it measures nothing.

A real reading trembles by more than its last digit while the wheel turns. One that stays the same to the last bit for
long, while those of most other wheels do not, is stuck. Nothing is said of a rover that stands, nor when all stay the
same: then nobody trembles, on a bench without noise for instance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.pipeline.snapshot import ROW, WHEELS, Snapshot
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Quantity

WATCHED = tuple(quantity for quantity in QUANTITIES if quantity.noisy)
STUCK_NS = 5_000_000_000
STUCK_SNAPSHOTS = 20
"""Both must have passed: a slow converter repeats itself at a fast SYNC, and a few equal readings are no wonder."""
OTHERS = 3
"""So many other wheels' readings must have changed meanwhile."""


class StuckSensorDetector:
    """Feed it every snapshot; `stuck` says which sensors repeat themselves."""

    def __init__(self) -> None:
        self._rows = [ROW[quantity] for quantity in WATCHED]
        self._last = np.full((len(WATCHED), WHEELS), np.nan)
        self._repeats = np.zeros((len(WATCHED), WHEELS), np.int64)
        self._since_ns = np.zeros((len(WATCHED), WHEELS), np.int64)
        self._now_ns = 0

    def step(self, snapshot: Snapshot) -> None:
        """Take one more snapshot; wheels that stand, or are not measured, begin anew."""
        values = snapshot.values[self._rows]
        same = (values == self._last) & (np.abs(snapshot.motor_speed_rad_s) > 0)
        self._repeats = np.where(same, self._repeats + 1, 0)
        self._since_ns = np.where(same, self._since_ns, snapshot.time_ns)
        self._last = values
        self._now_ns = snapshot.time_ns

    @property
    def stuck(self) -> tuple[tuple[Quantity, int], ...]:
        """The sensors that are stuck: what they measure, and the wheel (1–6)."""
        if not self._repeats.any():
            return ()
        lasting = (self._repeats >= STUCK_SNAPSHOTS) & (self._now_ns - self._since_ns >= STUCK_NS)
        measured = np.isfinite(self._last)
        found = []
        for quantity, long, there in zip(WATCHED, lasting, measured, strict=True):
            if np.sum(there & ~long) >= OTHERS:
                found += [(quantity, int(wheel) + 1) for wheel in np.flatnonzero(long)]
        return tuple(found)
