"""A drive, as fast as the computer can: the world's sensors ▸ frames ▸ the daemon's own chain ▸ its recording.

Nothing here knows what the numbers mean; the frames could be a bus's, and the files are what the daemon leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.closed_loop.telemetry import frames
from regolithd.daemon.pipeline.chain import Chain
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.simulator.virtual_rover import Truth, VirtualWorld

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.daemon.closed_loop.mission import Mission
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.daemon.pipeline.terrain_network import Network
    from regolithd.daemon.simulator.scenario import Scenario
    from regolithd.drivers.can.frame import Frame

START_NS = 1_370_959_642_000_000_000
"""June 2013: an instant like any other."""


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """What the bus carried, and what really was: for each SYNC its frames and its truth."""

    frames: tuple[tuple[Frame, ...], ...]
    truth: tuple[Truth, ...]


def drive(scenario: Scenario, configuration: Configuration, mission: Mission) -> Driven:
    """Drive the mission in the world of the scenario."""
    world, nodes = VirtualWorld(scenario), configuration.nodes.described()
    heard, truth = [], []
    for time_s, wheel_speed in zip(mission.time_s.tolist(), mission.wheel_speed_rad_s.tolist(), strict=True):
        speed = np.full(6, wheel_speed * scenario.drivetrain.ratio)
        read = world.measure(time_s, speed)
        heard.append(tuple(frames(nodes, START_NS + round(time_s * 1e9), speed, read)))
        if world.truth is not None:
            truth.append(world.truth)
    return Driven(tuple(heard), tuple(truth))


def estimates(driven: Driven, configuration: Configuration, network: Network) -> Iterator[Estimate]:
    """Yield what the daemon with this configuration makes of a drive, one estimate for each SYNC."""
    chain = Chain(configuration, network)
    for batch in driven.frames:
        yield from chain.feed(batch)


def record(driven: Driven, configuration: Configuration, network: Network, folder: Path) -> Path:
    """Record a drive as the daemon does, and return its MCAP file."""
    settings = configuration.recording.model_copy(update={"directory": folder})
    recorder = Recorder(settings, configuration.bus.channel, {"rover": configuration.rover.name}, lambda: START_NS)
    if recorder.paths is None:
        raise OSError(recorder.trouble)
    mcap, _ = recorder.paths
    for number, batch in enumerate(driven.frames):
        recorder.frames(batch)
        if number % 20 == 0:
            recorder.flush()
    for number, estimate in enumerate(estimates(driven, configuration, network)):
        recorder.estimate(estimate)
        if number % 20 == 0:
            recorder.flush()
    recorder.close()
    if recorder.trouble:
        raise OSError(recorder.trouble)
    return mcap
