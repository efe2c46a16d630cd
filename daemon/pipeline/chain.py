"""CAN frames in, estimates out: the same code, and the same numbers, for a live bus and for a replayed log.

frames ─▶ Decoder ─▶ Sync, Reading ─▶ Acquisition ─▶ Snapshot ─▶ Pipeline ─▶ Estimate

chain = Chain(configuration, load_models(configuration))
for estimate in chain.feed(frames): …
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.daemon.pipeline.pipeline import Pipeline
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading, Sync

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.onnx_models import OnnxModels
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.decoding.signals import Signal


class Chain:
    """Decoder, acquisition and pipeline in a row; no clock, no input or output."""

    def __init__(self, configuration: Configuration, models: OnnxModels) -> None:
        nodes = configuration.nodes.described()
        self.decoder = Decoder(nodes)
        period_ns = int(1e9 / configuration.sync.rate_Hz)
        self.acquisition = Acquisition(nodes, self.decoder.expected, period_ns)
        self.pipeline = Pipeline(configuration, models)

    def feed(self, frames: Iterable[Frame]) -> list[Estimate]:
        """Take the next frames of the bus; return an estimate for each snapshot that they complete."""
        decode = self.decoder.decode
        return self.take([signal for frame in frames if (signal := decode(frame)) is not None])

    def take(self, signals: Iterable[Signal]) -> list[Estimate]:
        """Take the next decoded signals; return an estimate for each snapshot that they complete."""
        estimates = []
        for signal in signals:
            if isinstance(signal, Reading | Sync):
                snapshot = self.acquisition.accept(signal)
                if snapshot is not None:
                    estimates.append(self.pipeline.step(snapshot))
        return estimates
