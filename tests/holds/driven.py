"""The frames of a virtual rover that drives, without a bus and without waiting."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.simulator.pdo_frames import frames
from regolithd.daemon.simulator.scenario import Scenario
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.drivers.can.frame import Frame

START_NS = 1_370_959_642_000_000_000
SPEEDS_RAD_S = (0.3, 0.2, -0.3, 0.0, 0.35)
EACH_S = 40.0


def batches(count: int, seed: int, rate_Hz: float = 2.0) -> Iterator[list[Frame]]:
    """Yield the frames of `count` SYNCs, one after the other."""
    nodes, world = Configuration().described(), VirtualWorld(Scenario(seed=seed))
    for k in range(count):
        time_s = k / rate_Hz
        speed = np.full(6, SPEEDS_RAD_S[int(time_s / EACH_S) % len(SPEEDS_RAD_S)] * Scenario().drivetrain.ratio)
        yield list(frames(nodes, START_NS + round(time_s * 1e9), speed, world.measure(time_s, speed)))
