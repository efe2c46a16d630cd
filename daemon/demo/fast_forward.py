"""Computes the first part of the demo's drive without waiting: virtual rover ▸ CAN frames ▸ the daemon's pipeline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.simulator.pdo_frames import frames

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.daemon.demo.ground_truth_log import GroundTruthLog
    from regolithd.daemon.demo.story import FastPart
    from regolithd.daemon.service import Service
    from regolithd.daemon.simulator.virtual_rover import VirtualWorld
    from regolithd.drivers.virtual.plant import Array, Measurement

FLUSH_EVERY = 100


def fast_forward(
    fast: FastPart, world: VirtualWorld, service: Service, truth: GroundTruthLog, start_ns: int
) -> Iterator[float]:
    """Drive the fast part; the service computes and records as it does live. Yield the seconds driven, now and then."""
    nodes = service.configuration.described()
    ratio = world.scenario.drivetrain.ratio
    for number, (time_s, wheel_speed) in enumerate(zip(fast.time_s, fast.wheel_speed_rad_s, strict=True)):
        speed = np.full(6, wheel_speed * ratio)
        read = world.measure(float(time_s), speed)
        batch = list(frames(nodes, start_ns + round(time_s * 1e9), speed, read))
        if service.recorder is not None:
            service.recorder.frames(batch)
        for estimate in service.chain.feed(batch):
            truth.estimate(estimate)
            if service.recorder is not None:
                service.recorder.estimate(estimate)
        if number % FLUSH_EVERY == 0:
            if service.recorder is not None:
                service.recorder.flush()
            yield float(time_s)


class LaterWorld:
    """The same world, for nodes that are switched on when `begun_s` of its time have passed."""

    def __init__(self, world: VirtualWorld, begun_s: float) -> None:
        self._world = world
        self._begun_s = begun_s

    def measure(self, time_s: float, motor_speed_rad_s: Array) -> Measurement:
        """Advance to `time_s` since the nodes were switched on, and return the sensors' readings."""
        return self._world.measure(self._begun_s + time_s, motor_speed_rad_s)
