"""A day is acquired without waiting: recorded, and handed to the publisher; then its logs are replayed.

Compared are the bytes of each `snapshot` message: those that were handed to the store of the publisher, and those that
the replayed estimates give.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from driven import batches

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores
from regolithd.daemon.recording.candump import read_log
from regolithd.daemon.recording.recorder import Recorder

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.pipeline.snapshot import Estimate

FLUSHED_EVERY = 100


@dataclass(frozen=True)
class Day:
    """Snapshots and bytes that were published and replayed, whether they are equal, and the size of the logs."""

    snapshots: int
    replayed: int
    equal: bool
    published_MB: float
    logs_MB: float
    files: int


class Published:
    """Publishes estimates into a store that it empties, and keeps a digest of the bytes of the snapshots."""

    def __init__(self, folder: Path, session: str = "") -> None:
        self._stores = Stores.open(folder, 50_000_000)
        self._publisher = Publisher(Configuration(), self._stores)
        self._publisher.session = session or self._publisher.session
        self.session = self._publisher.session
        self.digest = hashlib.sha256()
        self.count = self.bytes = 0

    def take(self, estimate: Estimate) -> None:
        """Publish one estimate."""
        self._publisher.estimate(estimate)
        store = self._stores.snapshots
        for record in store.read(store.first):
            self.digest.update(record.payload)
            self.count += 1
            self.bytes += len(record.payload)
            store.acknowledge(record.index + 1, 1)

    def close(self) -> None:
        """Close the store."""
        self._stores.close()


def replay_day(folder: Path, seconds: float, rate_Hz: float, seed: int) -> Day:
    """Acquire `seconds` of driving, replay the logs, and compare."""
    configuration = Configuration.model_validate(
        {"drivetrain": {"no_load_current_A": [0.03] * 6}, "recording": {"directory": folder / "rec", "limit_MB": 1e5}}
    )
    models = load_models(configuration)
    chain = Chain(configuration, models)
    recorder = Recorder(configuration.recording, "can0", {"configuration": configuration.model_dump_json()})
    published = Published(folder / "published")
    for number, batch in enumerate(batches(int(seconds * rate_Hz), seed, rate_Hz)):
        recorder.frames(batch)
        for estimate in chain.feed(batch):
            recorder.estimate(estimate)
            published.take(estimate)
        if number % FLUSHED_EVERY == 0:
            recorder.flush()
    recorder.close()
    published.close()
    replayed = Published(folder / "replayed", published.session)
    chain = Chain(configuration, models)
    logs = sorted((folder / "rec").glob("*.log"))
    for log in logs:
        for frame in read_log(log):
            for estimate in chain.feed([frame]):
                replayed.take(estimate)
    replayed.close()
    return Day(
        published.count,
        replayed.count,
        published.digest.digest() == replayed.digest.digest() and published.count == int(seconds * rate_Hz),
        published.bytes / 1e6,
        sum(log.stat().st_size for log in logs) / 1e6,
        len(logs),
    )
