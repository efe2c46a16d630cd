"""Records frames, snapshots, estimates and events in pairs of files, `rover-TIME-NUMBER.log` and `.mcap`.

| event | what the recorder does |
|---|---|
| `flush`, called every `FLUSH_S` | writes to the kernel, so that a killed daemon loses less than the last second |
| `file_minutes` have passed | closes the pair, begins a new one |
| all files together exceed `limit_MB`, or the disk has less than `RESERVE` of it left | deletes the oldest files |
| the disk fails or is full | closes the pair, sets `problem`, tries a new pair every `RETRY_S`; nothing else stops |

The wall clock may be set back at any time. It only names the files; pauses are measured by a monotonic clock, and
NUMBER, which rises from pair to pair, says which files are the oldest.
"""

from __future__ import annotations

import re
import shutil
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import IO, TYPE_CHECKING

from regolithd.daemon.recording.candump import frame_line
from regolithd.daemon.recording.content import ESTIMATE, EVENT, SNAPSHOT, estimate_json, snapshot_json
from regolithd.daemon.recording.layout import write_layout
from regolithd.daemon.recording.mcap_file import McapFile
from regolithd.daemon.recording.schemas import schema

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from regolithd.daemon.config.configuration import Recording
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.drivers.can.frame import Frame

FLUSH_S = 0.4
RETRY_S = 10.0
MEGABYTE = 1_000_000
RESERVE = 0.05
"""Share of the limit that must stay free on the disk; otherwise the oldest recordings are deleted."""
_NUMBERED = re.compile(r"rover-\d{8}T\d{6}Z-(\d{6,})")


@dataclass(slots=True)
class _Pair:
    """The two files being written."""

    mcap: McapFile
    log: IO[str]
    mcap_path: Path
    log_path: Path
    begun_ns: int

    def flush(self) -> None:
        self.log.flush()
        self.mcap.flush()

    def close(self) -> None:
        try:
            self.mcap.close()
        finally:
            self.log.close()


class Recorder:
    """Owns the recording's files. Call `flush` every `FLUSH_S`; the other methods only append.

    Parameters
    ----------
    settings
        `[recording]`: folder, limit, length of a file.
    interface
        The CAN interface's name in the log.
    metadata
        Metadata of every file: configuration, version of the terrain network, start.
    now_ns
        The clock from which the files are named.
    preamble
        Returns the frames that each log begins with: those that state the devices' units.
    monotonic_ns
        The clock by which pauses and the length of a file are measured.
    """

    def __init__(
        self,
        settings: Recording,
        interface: str,
        metadata: Mapping[str, str],
        now_ns: Callable[[], int] = time.time_ns,
        preamble: Callable[[], Sequence[Frame]] = tuple,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._settings = settings
        self._interface = interface
        self._metadata = metadata
        self._now_ns = now_ns
        self._preamble = preamble
        self._monotonic_ns = monotonic_ns
        self._pair: _Pair | None = None
        self._retry_ns = 0
        self.problem: str | None = None
        self.lost = 0  # frames that could not be written
        self._attempt(self._open)

    @property
    def paths(self) -> tuple[Path, Path] | None:
        """Return the MCAP file and the log that are being written."""
        return (self._pair.mcap_path, self._pair.log_path) if self._pair else None

    def frames(self, batch: Sequence[Frame]) -> None:
        """Append frames to the log."""
        pair = self._pair
        if pair is None:
            self.lost += len(batch)
            return
        lines = "".join([frame_line(frame, self._interface) for frame in batch])
        self._attempt(lambda: pair.log.write(lines))

    def estimate(self, estimate: Estimate) -> None:
        """Append a snapshot and its estimate."""
        if pair := self._pair:
            time_ns, sequence = estimate.snapshot.time_ns, estimate.snapshot.sequence
            raw, made = snapshot_json(estimate.snapshot), estimate_json(estimate)
            self._attempt(lambda: pair.mcap.write(SNAPSHOT, time_ns, raw, sequence))
            self._attempt(lambda: pair.mcap.write(ESTIMATE, time_ns, made, sequence))

    def event(self, time_ns: int, content: bytes) -> None:
        """Append an event, as JSON."""
        if pair := self._pair:
            self._attempt(lambda: pair.mcap.write(EVENT, time_ns, content))

    def flush(self) -> None:
        """Write everything to the kernel; begin a new pair when it is due, or after a failure."""
        now = self._monotonic_ns()
        if self._pair is None:
            if now >= self._retry_ns:
                self._attempt(self._open)
            return
        self._attempt(self._pair.flush)
        if self._pair and now - self._pair.begun_ns > self._settings.file_minutes * 60e9:
            self._attempt(self._begin_new_pair)

    def close(self) -> None:
        """Write the indexes and close both files."""
        pair, self._pair = self._pair, None
        if pair:
            self._attempt(pair.close)

    def _begin_new_pair(self) -> None:
        self.close()
        self._open()

    def _open(self) -> None:
        folder = self._settings.directory
        folder.mkdir(parents=True, exist_ok=True)
        self._make_room()
        write_layout(folder)
        stem = _next_stem(folder, self._now_ns())
        log = stem.with_suffix(".log").open("x", encoding="ascii")
        log.writelines(frame_line(frame, self._interface) for frame in self._preamble())
        mcap = McapFile(stem.with_suffix(".mcap").open("xb"), self._metadata, schema)
        self._pair = _Pair(mcap, log, stem.with_suffix(".mcap"), stem.with_suffix(".log"), self._monotonic_ns())
        self.problem = None

    def _make_room(self) -> None:
        """Delete the oldest files until all of them are within the limit and the disk has its reserve."""
        folder = self._settings.directory
        limit = self._settings.limit_MB * MEGABYTE
        files = [(path, path.stat().st_size) for path in _oldest_first(folder)]
        total = sum(size for _, size in files)
        for path, size in files:
            if total <= limit and shutil.disk_usage(folder).free >= RESERVE * limit:
                return
            path.unlink()
            total -= size

    def _attempt(self, action: Callable[[], object]) -> None:
        """Run an action that writes to the disk; if it fails, close this pair and set `problem`."""
        try:
            action()
        except OSError as error:
            self.problem = f"{self._settings.directory}: {error.strerror or error}"
            self._retry_ns = self._monotonic_ns() + int(RETRY_S * 1e9)
            pair, self._pair = self._pair, None
            if pair:
                _abandon(pair)


def _abandon(pair: _Pair) -> None:
    for close in (pair.log.close, pair.mcap.close):
        try:
            close()
        except OSError:
            continue  # `problem` already holds the reason


def _oldest_first(folder: Path) -> list[Path]:
    """Return the files of all recordings by their numbers; first those of version 0.1, which have none, by name."""
    ours = [path for path in folder.glob("rover-*") if path.suffix in {".mcap", ".log"}]
    return sorted(ours, key=lambda path: (_number(path), path.name))


def _number(path: Path) -> int:
    match = _NUMBERED.fullmatch(path.stem)
    return int(match[1]) if match else 0


def _next_stem(folder: Path, now_ns: int) -> Path:
    number = 1 + max(map(_number, _oldest_first(folder)), default=0)
    moment = datetime.fromtimestamp(now_ns // 1_000_000_000, UTC)
    return folder / f"rover-{moment:%Y%m%dT%H%M%SZ}-{number:06d}"
