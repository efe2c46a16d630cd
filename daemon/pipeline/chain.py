"""Frames in, estimates out – the same code and the same numbers, whether the bus speaks or a log.

numbers = Chain(configuration, network)
for estimate in numbers.feed(frames): …
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.daemon.pipeline.pipeline import Pipeline
from regolithd.drivers.canopen.decoder import Decoder
from regolithd.drivers.signals import Reading, Sync

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.daemon.pipeline.terrain_network import Network
    from regolithd.drivers.can.frame import Frame


class Chain:
    """Decoder, acquisition and pipeline in a row; no clock, no input or output."""

    def __init__(self, configuration: Configuration, network: Network) -> None:
        nodes = configuration.nodes.described()
        self.decoder = Decoder(nodes)
        period_ns = int(1e9 / configuration.sync.rate_Hz)
        self.acquisition = Acquisition(nodes, self.decoder.expected, period_ns)
        self.pipeline = Pipeline(configuration, network)

    def feed(self, frames: Iterable[Frame]) -> list[Estimate]:
        """Take the next frames of the bus; return an estimate for each snapshot that they complete."""
        estimates = []
        for frame in frames:
            signal = self.decoder.decode(frame)
            if isinstance(signal, Reading | Sync):
                snapshot = self.acquisition.accept(signal)
                if snapshot is not None:
                    estimates.append(self.pipeline.step(snapshot))
        return estimates


class Digest:
    """A SHA-256 over everything that estimates hold, bit by bit: equal digests mean equal numbers."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self.count = 0

    def add(self, estimate: Estimate) -> None:
        """Take one more estimate."""
        snapshot = estimate.snapshot
        self._hash.update(np.array([snapshot.sequence, snapshot.time_ns], np.int64).tobytes())
        for array in (
            snapshot.values,
            estimate.wheel_torque_Nm,
            estimate.smoothed_torque_Nm,
            estimate.smoothed_load_N,
            estimate.slip,
            estimate.cohesion_Pa,
            estimate.friction_angle_rad,
        ):
            self._hash.update(np.where(np.isnan(array), np.nan, array).tobytes())  # one NaN for all
        self._hash.update(estimate.outside.tobytes() + "".join(estimate.slip_source).encode())
        self._hash.update(repr((estimate.posterior, estimate.soil_change)).encode())  # floats in full
        self.count += 1

    def __str__(self) -> str:
        """Return the digest in hex."""
        return self._hash.hexdigest()
