"""Replays candump logs through the pipeline, and compares the numbers with those recorded."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Any

from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.recording.candump import open_log, read_log
from regolithd.daemon.recording.content import ESTIMATE, SNAPSHOT, as_written_today, estimate_json, snapshot_json
from regolithd.daemon.recording.digest import Digest
from regolithd.daemon.recording.mcap_file import incomplete, read_messages
from regolithd.daemon.recording.mcap_records import MAGIC

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.onnx_models import OnnxModels
    from regolithd.daemon.pipeline.snapshot import AcquisitionCounters, Estimate
    from regolithd.drivers.can.frame import Frame

BATCH = 256
"""Frames that are processed at a time; the numbers do not depend on it."""


class ReplayError(Exception):
    """There is nothing to replay; the message says why and what to do."""


@dataclass(slots=True)
class Replayed:
    """The result of a replay: `compared` recorded messages, of which those listed in `different` were not the same.

    `damage` names what was left out of logs and recordings because it cannot be read, and `incomplete` the recordings
    that end early.
    """

    frames: int = 0
    digest: Digest = field(default_factory=Digest)
    counters: AcquisitionCounters | None = None
    undecodable: dict[str, int] = field(default_factory=dict)
    compared: int = 0
    different: list[str] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    incomplete: list[str] = field(default_factory=list)

    @property
    def not_compared(self) -> int:
        """Messages that the logs give, and that no recording has."""
        return 2 * self.digest.count - self.compared


def replay_logs(
    logs: Iterable[Path],
    configuration: Configuration,
    models: OnnxModels,
    opening: Callable[[Path], AbstractContextManager[IO[str]]] = open_log,
) -> Replayed:
    """Feed the logs through the pipeline in their order, and compare with the MCAP files beside them, if any.

    `opening` opens a log; it may show progress.

    Raises
    ------
    ReplayError
        A log holds no frame. An empty one is left out where others hold some.
    """
    result = Replayed()
    chain = Chain(configuration, models)
    recorded: dict[tuple[str, int], dict[str, Any]] = {}
    empty: list[Path] = []
    for log in logs:
        recorded |= _recorded(log.with_suffix(".mcap"), result)
        before, unreadable = result.frames, list[int]()
        for batch in _batches(read_log(log, opening, unreadable.append)):
            result.frames += len(batch)
            for estimate in chain.feed(batch):
                result.digest.add(estimate)
                _compare(estimate, recorded, result)
        if result.frames == before:
            empty.append(_without_frames(log))
        elif unreadable:
            what = f"{len(unreadable)} lines that cannot be read are left out, the first is line {unreadable[0]}"
            result.damage.append(f"{log}: {what}.")
    if empty and not result.frames:
        raise ReplayError(f"{empty[0]}: it is empty: 0 bytes. Give a candump log with frames.")
    result.incomplete += [f"{log}: is empty: 0 bytes." for log in empty]
    result.counters = chain.acquisition.counters
    result.undecodable = {str(reason): count for reason, count in chain.decoder.undecodable.items()}
    result.different += [
        f"{topic} {sequence} was recorded, but the log does not give it" for topic, sequence in recorded
    ]
    return result


def _without_frames(log: Path) -> Path:
    """Return the log if it is empty; otherwise say what it is instead.

    Raises
    ------
    ReplayError
        It is not empty.
    """
    with log.open("rb") as stream:
        begin = stream.read(len(MAGIC))
    if begin == MAGIC:
        raise ReplayError(f"{log}: this is an MCAP file. Give the candump log beside it: {log.with_suffix('.log')}")
    if begin:
        what = "no line of it is that of a candump log, (1436509052.249713) can0 181#3702F8FF00000000"
        raise ReplayError(f"{log}: {what}. Give a log of the recording, or one of `candump -L`.")
    return log


def _recorded(mcap: Path, result: Replayed) -> dict[tuple[str, int], dict[str, Any]]:
    if not mcap.is_file():
        return {}
    if text := incomplete(mcap):
        result.incomplete.append(text)
    return {
        (message.topic, message.content["sequence"]): as_written_today(message.content)
        for message in read_messages(mcap, on_gap=result.damage.append)
        if message.topic in {SNAPSHOT, ESTIMATE}
    }


def _compare(estimate: Estimate, recorded: dict[tuple[str, int], dict[str, Any]], result: Replayed) -> None:
    for topic, made in ((SNAPSHOT, snapshot_json(estimate.snapshot)), (ESTIMATE, estimate_json(estimate))):
        then = recorded.pop((topic, estimate.snapshot.sequence), None)
        if then is None:
            continue
        result.compared += 1
        now = json.loads(made)
        if names := [name for name in then.keys() | now.keys() if then.get(name) != now.get(name)]:
            result.different.append(f"{topic} {estimate.snapshot.sequence}: {', '.join(sorted(names))}")


def _batches(frames: Iterator[Frame]) -> Iterator[list[Frame]]:
    batch: list[Frame] = []
    for frame in frames:
        batch.append(frame)
        if len(batch) == BATCH:
            yield batch
            batch = []
    yield batch
