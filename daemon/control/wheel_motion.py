"""What the wheels really do, by the measured motor speeds: how far they turn, and whether they follow the command.

A wheel does not follow where its mean speed over a window differs from the commanded one by more than `TOLERANCE`, and
has not come closer since the window before, as it does on a ramp. A window lasts `WINDOW_S` and `WINDOW_SNAPSHOTS`, so
that a single reading counts for little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.pipeline.snapshot import WHEELS
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Array, Mask, Snapshot

TOLERANCE = 0.2
"""Share of the commanded speed by which a wheel may differ from it: sound drives keep to a few percent."""
APPROACH = 0.05
"""Share of the commanded speed by which a wheel on a ramp comes closer to it from window to window."""
WINDOW_S = 1.0
WINDOW_SNAPSHOTS = 3
GAP_S = 2.5
"""A wheel that was not measured for this long is not said to have turned meanwhile."""
COMPLETE = 0.95
"""Share of the distance that every wheel must have turned; up to one SYNC period more is not seen at begin and end."""
UNSEEN = 0.9
"""Where the distance takes hardly longer than a SYNC period: the share that may remain unseen at most."""


class WheelMotion:
    """Takes every snapshot; counts distances since `begin`, and compares speeds with those `commanded`.

    Attributes
    ----------
    problem
        Which wheels have not done what was commanded last; empty where all have. It stays until the next traverse.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.problem = ""
        self._nodes = [
            f"wheel {(node.wheel or 0) + 1} (node {node.node_id})"
            for _, node in configuration.nodes.by_key()
            if node.device is MOTOR_CONTROLLER
        ]
        self._ratio = configuration.drivetrain.ratio
        self._radius_m = configuration.wheel.radius_m
        self._standstill_rad_s = configuration.slip.standstill_rad_s
        self._period_s = 1 / configuration.sync.rate_Hz
        self._speed = np.full(WHEELS, np.nan)  # of the last snapshot [rad/s at the wheel]
        self._snapshots = 0
        self._measured_ns = np.zeros(WHEELS, np.int64)  # when each wheel was last measured, and its speed then
        self._measured = np.full(WHEELS, np.nan)
        self._angle = np.zeros(WHEELS)
        self._direction = 1.0
        self._window = _Window(0.0)

    def take(self, snapshot: Snapshot) -> None:
        """Take one more snapshot."""
        self._snapshots += 1
        self._speed = snapshot.motor_speed_rad_s / self._ratio
        elapsed_s = (snapshot.time_ns - self._measured_ns) / 1e9
        step = (self._speed + self._measured) / 2 * elapsed_s
        known = np.isfinite(step) & (elapsed_s > 0) & (elapsed_s <= max(GAP_S, 2 * self._period_s))
        self._angle += np.where(known, step, 0.0)
        there = np.isfinite(self._speed)
        self._measured = np.where(there, self._speed, self._measured)
        self._measured_ns = np.where(there, snapshot.time_ns, self._measured_ns)
        if self._window.commanded:
            self._watch(self._window.take(snapshot.time_ns, self._speed))

    def begin(self, *, forward: bool) -> None:
        """Begin a traverse: distances are 0, and nothing is wrong."""
        self.problem = ""
        self._angle[:] = 0.0
        self._direction = 1.0 if forward else -1.0

    def commanded(self, wheel_speed_rad_s: float) -> None:
        """Note that all wheels have been commanded to turn at this speed."""
        self._window = _Window(wheel_speed_rad_s)

    @property
    def turned_m(self) -> float:
        """How far the rims have moved in the commanded direction; mean of the wheels."""
        return float(np.mean(self._distances_m))

    def shortfall(self, distance_m: float, speed_m_s: float) -> str:
        """Return which wheels have turned less than this distance, as text; empty where all have turned it."""
        unseen = (1 - COMPLETE) * distance_m + abs(speed_m_s) * self._period_s
        short = self._distances_m < distance_m - min(unseen, UNSEEN * distance_m)
        if short.any():
            turned = (f"{self._nodes[k]} {self._distances_m[k]:.3f} m" for k in np.flatnonzero(short))
            self.problem = f"of {distance_m:.3f} m commanded, only these were measured: {', '.join(turned)}"
            return f"the time is over; {self.problem}"
        return ""

    def standstill_detector(self) -> Callable[[], bool]:
        """Return a function that says whether all wheels stand still, by a snapshot whose SYNC came after this call."""
        begun = self._snapshots

        def standing() -> bool:
            if self._snapshots < begun + 2:  # the first SYNC may have come before this call
                return False
            # A wheel that was not measured (NaN) may turn.
            return bool(np.all(np.abs(self._speed) < self._standstill_rad_s))

        return standing

    @property
    def _distances_m(self) -> Array:
        return self._direction * self._angle * self._radius_m

    def _watch(self, lagging: Mask | None) -> None:
        if lagging is None or not lagging.any() or self.problem:
            return
        wheels: Iterable[int] = np.flatnonzero(lagging)
        said = ", ".join(f"{self._nodes[k]} at {self._window.mean[k]:.3f}" for k in wheels)
        self.problem = f"commanded to turn at {self._window.commanded:.3f} rad/s, and measured: {said} rad/s"


class _Window:
    """Mean speeds over one window after the other, beside the commanded one [rad/s at the wheel]."""

    def __init__(self, commanded: float) -> None:
        self.commanded = commanded
        self.mean = np.full(WHEELS, np.nan)
        self._deviation = np.full(WHEELS, np.inf)  # of the window before
        self._begun_ns: int | None = None
        self._speeds: list[Array] = []

    def take(self, time_ns: int, speed: Array) -> Mask | None:
        """Take the speeds of one snapshot; return which wheels do not follow, where it ends a window."""
        if self._begun_ns is None:  # this SYNC may have come before the command
            self._begun_ns = time_ns
            return None
        self._speeds.append(speed)
        if len(self._speeds) < WINDOW_SNAPSHOTS or time_ns - self._begun_ns < WINDOW_S * 1e9:
            return None
        self.mean = np.mean(self._speeds, axis=0)  # NaN, and so not judged, where a reading is missing
        deviation = np.abs(self.mean / self.commanded - 1)
        lagging: Mask = (deviation > TOLERANCE) & (deviation > self._deviation - APPROACH)
        self._deviation, self._begun_ns, self._speeds = deviation, time_ns, []
        return lagging
