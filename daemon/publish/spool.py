"""What the broker has not acknowledged yet, on disk: bounded, in order, safe against kill -9.

Every message that must not be lost is appended here first and sent then (a write-ahead log), so there is one path for
live and for late, and its order is the order of the index. Files are small (`daemon.publish.segment`) and go when all
their records are acknowledged. `acknowledged` holds the first index that is not, with a checksum.

    spool = Spool(directory, limit_bytes=200_000_000)
    index = spool.append("snapshot", payload)     # in the kernel's hands now: a kill of this process loses nothing
    for record in spool.read(index): …            # from there on, as many as are at hand
    spool.acknowledge(index + 1, records=1)       # everything before this

While the broker keeps up, nothing is synced: files are deleted before the kernel gets to writing them, so an SD card is
spared. When messages wait, `sync` is called once a second; a power cut then costs a second at most.

Full: the oldest file is deleted, and `dropped` counts what was in it. Disk full, failing or read-only: a message waits
in memory alone, and `unstored` counts it. Nothing that a disk does raises an error here once the store is open.
"""

from __future__ import annotations

import fcntl
import os
import struct
import time
import zlib
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import TYPE_CHECKING

from regolithd.daemon.publish.segment import SUFFIX, Record, Segment, pack

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

RECENT = 512
"""Records that are kept in memory as well: a broker that keeps up costs no reading."""

_CURSOR = struct.Struct("<QI")


class SpoolError(Exception):
    """The store cannot be used; the message says why, and the cure."""


@dataclass(slots=True)
class SpoolCounters:
    """What became of the records since the start."""

    stored: int = 0
    acknowledged: int = 0
    dropped: int = 0  # never acknowledged, deleted because the store was full, or unreadable
    unstored: int = 0  # the disk refused them: they waited in memory alone
    torn: int = 0  # files with an end that could not be read


class Spool:
    """The store. One task uses it; only what `begin_sync` returns may run in a thread.

    Parameters
    ----------
    directory
        Its own; made when it is not there. A second process is refused.
    limit_bytes
        What all files together may take.
    """

    def __init__(self, directory: Path, limit_bytes: int, *, segment_bytes: int | None = None) -> None:
        self.directory = directory
        self.limit_bytes = limit_bytes
        self.segment_bytes = segment_bytes or min(1_000_000, max(4096, limit_bytes // 16))
        self.counters = SpoolCounters()
        self._recent: deque[Record] = deque(maxlen=RECENT)
        self._lock = self._take()
        self._cursor_file = os.open(directory / "acknowledged", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o640)
        self._first = self._read_cursor()
        self._segments = self._found()
        self._next = max(self._first, self._segments[-1].end if self._segments else 0)
        self._active: Segment | None = None
        self._forget_acknowledged()

    def _take(self) -> int:
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            lock = os.open(self.directory / "lock", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o640)
        except OSError as error:
            cure = "Give the daemon's user this folder, or choose another: [mqtt] spool_directory."
            raise SpoolError(f"{self.directory}: cannot be written: {error.strerror}. {cure}") from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(lock)
            raise SpoolError(f"{self.directory}: another regolithd uses it. Stop that one first.") from error
        return lock

    def _read_cursor(self) -> int:
        data = os.pread(self._cursor_file, _CURSOR.size, 0)
        if len(data) < _CURSOR.size:
            return 0
        first, checksum = _CURSOR.unpack(data)
        return int(first) if zlib.crc32(data[:8]) == checksum else 0

    def _found(self) -> list[Segment]:
        """Return the files that an earlier process left; only the last can be torn by a kill, and is looked through."""
        paths = sorted(path for path in self.directory.glob(f"*{SUFFIX}") if path.stem.isdigit())
        segments = [Segment.complete(path, int(after.stem)) for path, after in pairwise(paths)]
        if paths:
            last = Segment.found(paths[-1])
            self.counters.torn += last.torn
            if last.count:
                segments.append(last)
            else:
                last.remove()
        return segments

    @property
    def first(self) -> int:
        """The oldest index that is not acknowledged and not dropped; `next` where nothing waits."""
        return self._first

    @property
    def next(self) -> int:
        """The index that the next record will get."""
        return self._next

    @property
    def queued(self) -> int:
        """How many records wait."""
        return self._next - self._first

    @property
    def size_bytes(self) -> int:
        """What the files take."""
        return sum(segment.size for segment in self._segments)

    def append(self, topic: str, payload: bytes) -> int:
        """Store a message and return its index. What the disk refuses stays in memory, and is counted."""
        data = pack(topic, payload)
        index = self._next
        self._next += 1
        try:
            self._room_for(len(data), index).append(data)
            self.counters.stored += 1
        except OSError:
            self.counters.unstored += 1
            self._active = None  # the next record begins a file of its own, as this index is missing
        self._recent.append(Record(index, topic, payload, time.monotonic_ns()))
        return index

    def _room_for(self, size: int, index: int) -> Segment:
        active = self._active
        if active is None or active.size + size > self.segment_bytes:
            while self._segments and self.size_bytes + max(size, self.segment_bytes) > self.limit_bytes:
                self._drop_oldest()
            active = self._active = Segment.create(self.directory, index)
            self._segments.append(active)
            self._forget_acknowledged()
        return active

    def _drop_oldest(self) -> None:
        segment = self._segments.pop(0)
        segment.remove()
        self.counters.dropped += max(0, segment.end - max(self._first, segment.first))
        self._first = max(self._first, segment.end)

    def read(self, index: int) -> list[Record]:
        """Return records from `index` on (or from the first that is left), in order; empty where none is."""
        index = max(index, self._first)
        if index >= self._next:
            return []
        if self._recent and self._recent[0].index <= index:
            return list(islice(self._recent, index - self._recent[0].index, None))
        for segment in self._segments:
            if index < segment.end and (left := _readable(segment, index)):
                return left
        return list(self._recent)

    def acknowledge(self, end: int, records: int) -> None:
        """Forget everything before `end`: the broker has these `records`; any other could not be read and is lost."""
        if end > self._first:
            self.counters.acknowledged += records
            self.counters.dropped += max(0, end - self._first - records)
            self._move(end)

    def _move(self, first: int) -> None:
        self._first = first
        number = first.to_bytes(8, "little")
        with suppress(OSError):  # then the next process sends some again, marked late
            os.pwrite(self._cursor_file, number + zlib.crc32(number).to_bytes(4, "little"), 0)
        if self._segments and self._segments[0].end <= first:
            self._forget_acknowledged()

    def _forget_acknowledged(self) -> None:
        while self._segments and self._segments[0].end <= self._first and self._segments[0] is not self._active:
            self._segments.pop(0).remove()

    def begin_sync(self) -> Callable[[], None]:
        """Return what is to be called, in a thread, to bring everything that is stored by now to the disk."""
        files = [file for segment in self._segments if (file := segment.duplicate()) is not None]
        directory = os.open(self.directory, os.O_RDONLY | os.O_CLOEXEC)
        for segment in self._segments[:-1]:
            segment.close()  # complete: after this sync it needs none again

        def sync() -> None:
            for file in (*files, directory):
                try:
                    os.fsync(file)
                finally:
                    os.close(file)

        return sync

    def close(self) -> None:
        """Give the folder back; what waits stays."""
        for segment in self._segments:
            segment.close()
        if self._lock >= 0:
            os.close(self._cursor_file)
            os.close(self._lock)
            self._lock = -1


def _readable(segment: Segment, index: int) -> list[Record]:
    """Return what can be read from `index` on; what a failing disk keeps is counted when the next is acknowledged."""
    try:
        return [record for record in segment.read() if record.index >= index]
    except OSError:
        return []
