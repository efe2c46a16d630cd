"""Simulate a drive without waiting: virtual rover ▸ CAN frames ▸ the daemon's pipeline ▸ MCAP recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.pipeline.onnx_models import OnnxModels, load_posterior
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.simulator.pdo_frames import frames
from regolithd.daemon.simulator.virtual_rover import GroundTruth, VirtualWorld

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.daemon.closed_loop.speed_profile import SpeedProfile
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.daemon.pipeline.terrain_network import TerrainNetwork
    from regolithd.daemon.simulator.scenario import Scenario
    from regolithd.drivers.can.frame import Frame

START_NS = 1_370_959_642_000_000_000
"""Time of the first SYNC (11 June 2013, the paper's field trial)."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedDrive:
    """For each SYNC, the frames on the bus and the ground truth."""

    frames: tuple[tuple[Frame, ...], ...]
    truth: tuple[GroundTruth, ...]


def simulate(
    scenario: Scenario, configuration: Configuration, profile: SpeedProfile, start_ns: int = START_NS
) -> SimulatedDrive:
    """Drive the speed profile in the scenario; the configuration says which nodes answer."""
    world, nodes = VirtualWorld(scenario), configuration.described()
    batches, truth = [], []
    for time_s, wheel_speed in zip(profile.time_s.tolist(), profile.wheel_speed_rad_s.tolist(), strict=True):
        speed = np.full(6, wheel_speed * scenario.drivetrain.ratio)
        read = world.measure(time_s, speed)
        batches.append(tuple(frames(nodes, start_ns + round(time_s * 1e9), speed, read)))
        if world.truth is not None:
            truth.append(world.truth)
    return SimulatedDrive(tuple(batches), tuple(truth))


def estimates(drive: SimulatedDrive, configuration: Configuration, network: TerrainNetwork) -> Iterator[Estimate]:
    """Yield one estimate for each SYNC, as the daemon with this configuration computes it."""
    chain = Chain(configuration, OnnxModels(network, load_posterior(configuration)))
    for batch in drive.frames:
        yield from chain.feed(batch)


def record(drive: SimulatedDrive, configuration: Configuration, network: TerrainNetwork, folder: Path) -> Path:
    """Record a drive as the daemon does, and return the path of its MCAP file."""
    settings = configuration.recording.model_copy(update={"directory": folder})
    recorder = Recorder(settings, configuration.bus.channel, {"rover": configuration.rover.name}, lambda: START_NS)
    if recorder.paths is None:
        raise OSError(recorder.problem)
    mcap, _ = recorder.paths
    for number, batch in enumerate(drive.frames):
        recorder.frames(batch)
        if number % 20 == 0:
            recorder.flush()
    for number, estimate in enumerate(estimates(drive, configuration, network)):
        recorder.estimate(estimate)
        if number % 20 == 0:
            recorder.flush()
    recorder.close()
    if recorder.problem:
        raise OSError(recorder.problem)
    return mcap
