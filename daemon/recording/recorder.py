"""Records frames, snapshots, estimates and events in pairs of files, `rover-TIME-NUMBER.log` and `.mcap`.

| event | what the recorder does |
|---|---|
| `flush`, called every `FLUSH_S` | writes to the kernel, so that a killed daemon loses less than the last second |
| `file_minutes` have passed, or the pair is a tenth of the room (`ring`) | closes the pair, begins a new one |
| all files together exceed `limit_MB`, or the disk is nearly full | deletes the oldest pairs (`ring`) |
| the disk fails | closes the pair, sets `problem`, tries a new pair every `RETRY_S`; nothing else stops |

The wall clock may be set back at any time. It only names the files; pauses are measured by a monotonic clock.
"""

from __future__ import annotations

import errno
import os
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from typing import IO, TYPE_CHECKING

from regolithd.daemon.recording.candump import frame_line
from regolithd.daemon.recording.content import ESTIMATE, EVENT, SNAPSHOT, estimate_json, snapshot_json
from regolithd.daemon.recording.layout import write_layout
from regolithd.daemon.recording.mcap_file import McapFile
from regolithd.daemon.recording.ring import LARGEST_SHARE, MEGABYTE, Room, make_room, next_stem
from regolithd.daemon.recording.schemas import schema

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from regolithd.daemon.config.configuration import Recording
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.drivers.can.frame import Frame

FLUSH_S = 0.4
RETRY_S = 10.0
_NO_FOLDER = ("it, or a folder above it, is a file", "Remove it, or choose another: [recording] directory.")
_FULL = ("the disk is full", "Free space on the disk, or lower [recording] limit_MB.")
_EXPLAINED = {
    errno.EEXIST: _NO_FOLDER,
    errno.ENOTDIR: _NO_FOLDER,
    errno.ENOSPC: _FULL,
    errno.EDQUOT: _FULL,
    errno.EACCES: (
        "the daemon may not write there",
        "Make the daemon's user its owner, or choose another: [recording] directory.",
    ),
    errno.EROFS: ("the disk is mounted read-only", "`dmesg` says why; check the disk, and mount it writable."),
}
"""errno of an operation on a file → what is wrong, and what to do."""
_OTHER_REMEDY = "`dmesg` may say more; check the disk, or correct [recording] directory."


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

    @property
    def size(self) -> int:
        """Bytes of both files; somebody may have moved them meanwhile."""
        return self.mcap.size + os.fstat(self.log.fileno()).st_size

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
        self._room = Room(settings.limit_MB * MEGABYTE)
        self.problem: str | None = None
        self.remedy = ""  # of `problem`
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
        if self._pair:
            self._attempt(lambda: self._keep_within_room(now))

    def _keep_within_room(self, now: int) -> None:
        """Begin the next pair when this one is old or large; delete the oldest where the disk lacks its reserve."""
        assert self._pair is not None  # noqa: S101  # the caller's condition
        old = now - self._pair.begun_ns > self._settings.file_minutes * 60e9
        if old or self._pair.size > LARGEST_SHARE * self._room.size:
            self._begin_new_pair()
        elif self._room.is_short(self._settings.directory):
            self._make_room()

    @property
    def deletes_early(self) -> bool:
        """Return whether recordings are deleted although all are within the limit: the disk has less room."""
        return self._room.deleted_early

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
        self._pair, self.problem = self._begin(next_stem(folder, self._now_ns())), None

    def _begin(self, stem: Path) -> _Pair:
        """Return a new pair. A full disk lets files begin that cannot be written: those are deleted again."""
        mcap_path, log_path = stem.with_suffix(".mcap"), stem.with_suffix(".log")
        with ExitStack() as undo:
            log = log_path.open("x", encoding="ascii")
            undo.callback(_discard, log, log_path)
            stream = mcap_path.open("xb")
            undo.callback(_discard, stream, mcap_path)
            log.writelines(frame_line(frame, self._interface) for frame in self._preamble())
            pair = _Pair(McapFile(stream, self._metadata, schema), log, mcap_path, log_path, self._monotonic_ns())
            pair.flush()
            undo.pop_all()
        return pair

    def _make_room(self) -> None:
        stays = self._pair.log_path if self._pair else None
        limit_MB = self._settings.limit_MB
        room = make_room(self._settings.directory, limit_MB, stays)
        early = (self._room.deleted_early or room.deleted_early) and room.size < limit_MB * MEGABYTE
        self._room = replace(room, deleted_early=early)

    def _attempt(self, action: Callable[[], object]) -> None:
        """Run an action that writes to the disk; if it fails, close this pair and set `problem`."""
        try:
            action()
        except OSError as error:
            place = self._settings.directory
            what, self.remedy = _EXPLAINED.get(error.errno or 0, (error.strerror or str(error), _OTHER_REMEDY))
            self.problem = f"{place}: {what}"
            self._retry_ns = self._monotonic_ns() + int(RETRY_S * 1e9)
            pair, self._pair = self._pair, None
            if pair:
                _abandon(pair)


def _discard(stream: IO[str] | IO[bytes], path: Path) -> None:
    with suppress(OSError):
        stream.close()
    path.unlink(missing_ok=True)


def _abandon(pair: _Pair) -> None:
    for close in (pair.log.close, pair.mcap.close):
        try:
            close()
        except OSError:
            continue  # `problem` already holds the reason
