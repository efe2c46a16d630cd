"""The store on disk of messages that the broker has not acknowledged: bounded, in order, safe against kill -9.

A stored message is appended here before it is sent (a write-ahead log), so live and late messages take the same path,
in the order of the index. Files are small (`daemon.publish.segment`) and are deleted once all their records are
acknowledged. The file `acknowledged` holds the first index that is not, with a checksum.

    spool = Spool(directory, limit_bytes=200_000_000)
    index = spool.append("snapshot", payload)     # written to the kernel: a killed process loses nothing
    for record in spool.read(index): …            # from this index on, a batch
    spool.acknowledge(index + 1, records=1)       # everything before this

| state | what is done | what may be lost |
|---|---|---|
| the broker acknowledges in time | no sync: files are deleted before they reach the SD card | as in the next row |
| messages wait | `begin_sync` once a second | messages of one second, by a power cut |
| the store is full | the oldest file is deleted | its records, counted in `dropped` |
| the disk is full, failing or read-only | messages are kept in memory, counted in `unstored` | these, by a restart |
| a record is damaged | it is skipped, counted in `damaged`, and in `dropped` when one behind it is acknowledged | it |
| the folder cannot be used at the start | `Spool.memory_only`, an alarm | messages of earlier runs wait on the disk |
| the newest file cannot be read at the start | it is set aside (`.unreadable`), counted likewise | its records |

Once the store is open, no failure of the disk raises an error here.
"""

from __future__ import annotations

import errno
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

from regolithd.daemon.publish.segment import SUFFIX, Segment
from regolithd.daemon.publish.segment_format import pack
from regolithd.daemon.publish.segment_record import Record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

RECENT = 512
"""Records that are kept in memory as well: while the broker acknowledges in time, nothing is read from the disk."""

_CURSOR = struct.Struct("<QI")
_CLOSED = -1


class SpoolError(Exception):
    """The store cannot be used; the message says why, and what to do."""


class SpoolUnusableError(SpoolError):
    """The disk or its permissions are the reason; messages can be kept in memory (`Spool.memory_only`)."""


@dataclass(slots=True)
class SpoolCounters:
    """Counts of records since the start."""

    stored: int = 0
    acknowledged: int = 0
    dropped: int = 0  # never acknowledged, deleted because the store was full, or unreadable
    unstored: int = 0  # refused by the disk, and kept in memory only
    damaged: int = 0  # records that failed their checksum, and files that could not be read at the start
    torn: int = 0  # files with an end that could not be read


class Spool:
    """The store. One task uses it; only the function that `begin_sync` returns may run in a thread.

    Parameters
    ----------
    directory
        Its folder, created if missing. A second process is refused.
    limit_bytes
        Limit for the size of all files together.
    problem
        Why the folder is not to be used, as `Spool.memory_only` sets it; empty otherwise.

    Raises
    ------
    SpoolUnusableError
        The folder or its files cannot be opened.
    SpoolError
        Another process uses it.
    """

    def __init__(
        self, directory: Path, limit_bytes: int, *, segment_bytes: int | None = None, problem: str = ""
    ) -> None:
        self.directory = directory
        self.problem = problem
        self.limit_bytes = limit_bytes
        self.segment_bytes = segment_bytes or min(1_000_000, max(4096, limit_bytes // 16))
        self.counters = SpoolCounters()
        self._recent: deque[Record] = deque(maxlen=RECENT)
        self._active: Segment | None = None
        self._segments: list[Segment] = []
        self._first = 0
        self._lock = self._cursor_file = _CLOSED
        if not problem:
            self._open()
        self._next = max(self._first, self._segments[-1].end if self._segments else 0)
        self._delete_acknowledged()

    @classmethod
    def memory_only(cls, directory: Path, problem: str) -> Spool:
        """Return a store that keeps the newest `RECENT` messages in memory, and counts all as `unstored`."""
        return cls(directory, 0, problem=problem)

    def _open(self) -> None:
        self._lock = self._lock_directory()
        try:
            self._cursor_file = os.open(self.directory / "acknowledged", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o640)
            self._segments = self._found()
            self._first = self._read_cursor(self._segments[0].first if self._segments else 0)
        except OSError as error:
            self._segments.clear()
            self.close()
            raise self._unusable(error) from error

    def _unusable(self, error: OSError) -> SpoolUnusableError:
        remedy = "Make this folder writable for the daemon's user, or choose another: [mqtt] spool_directory."
        return SpoolUnusableError(
            f"{error.filename or self.directory}: cannot be written: {error.strerror or error}. {remedy}"
        )

    def _lock_directory(self) -> int:
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            lock = os.open(self.directory / "lock", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o640)
        except OSError as error:
            raise self._unusable(error) from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(lock)
            raise SpoolError(f"{self.directory}: another regolithd uses it. Stop that process first.") from error
        return lock

    def _read_cursor(self, otherwise: int) -> int:
        """Return the first index that is not acknowledged, or `otherwise` where the file does not hold it."""
        data = os.pread(self._cursor_file, _CURSOR.size, 0)
        if len(data) < _CURSOR.size:
            return otherwise
        first, checksum = _CURSOR.unpack(data)
        return int(first) if zlib.crc32(data[:8]) == checksum else otherwise

    def _found(self) -> list[Segment]:
        """Return the files of an earlier process; only the last may end in an incomplete record, so it is read."""
        paths = sorted(path for path in self.directory.glob(f"*{SUFFIX}") if path.stem.isdigit())
        segments = [Segment.complete(path, int(after.stem)) for path, after in pairwise(paths)]
        last = self._last(paths[-1]) if paths else None
        if last is not None:
            self.counters.torn += last.torn
            self.counters.damaged += last.damaged
            if last.count:
                segments.append(last)
            else:
                last.remove()
        return segments

    def _last(self, path: Path) -> Segment | None:
        try:
            return Segment.found(path)
        except OSError:  # with this name it would be in the way of the next file
            with suppress(OSError):
                path.rename(path.with_suffix(f"{SUFFIX}.unreadable"))
            self.counters.damaged += 1
            self.counters.dropped += 1
            return None

    @property
    def first(self) -> int:
        """The oldest index that is neither acknowledged nor dropped; equal to `next` where nothing waits."""
        return self._first

    @property
    def next(self) -> int:
        """The index that the next record will get."""
        return self._next

    @property
    def queued(self) -> int:
        """Number of records that wait."""
        return self._next - self._first

    @property
    def size_bytes(self) -> int:
        """Size of all files together."""
        return sum(segment.size for segment in self._segments)

    def append(self, topic: str, payload: bytes) -> int:
        """Store a message and return its index. If the disk refuses it, it stays in memory and is counted."""
        index = self._next
        data = pack(index, topic, payload)
        self._next += 1
        try:
            self._segment_for(len(data), index).append(data)
            self.counters.stored += 1
        except OSError:
            self.counters.unstored += 1
            self._active = None  # this index is missing from the file, so the next record begins a new one
        self._recent.append(Record(index, topic, payload, time.monotonic_ns()))
        return index

    def _segment_for(self, size: int, index: int) -> Segment:
        if self.problem:
            raise OSError(errno.EROFS, self.problem)
        active = self._active
        if active is None or active.size + size > self.segment_bytes:
            while self._segments and self.size_bytes + max(size, self.segment_bytes) > self.limit_bytes:
                self._drop_oldest()
            active = self._active = Segment.create(self.directory, index)
            self._segments.append(active)
            self._delete_acknowledged()
        return active

    def _drop_oldest(self) -> None:
        segment = self._segments.pop(0)
        segment.remove()
        self.counters.dropped += max(0, segment.end - max(self._first, segment.first))
        self._first = max(self._first, segment.end)

    def read(self, index: int) -> list[Record]:
        """Return records from `index` on (or from the first that exists), in order; empty where there are none."""
        index = max(index, self._first)
        if index >= self._next:
            return []
        if self._recent and self._recent[0].index <= index:
            return list(islice(self._recent, index - self._recent[0].index, None))
        for segment in self._segments:
            if index < segment.end and (left := self._readable(segment, index)):
                # What the disk refused before this file is in memory alone.
                return [record for record in self._recent if index <= record.index < left[0].index] or left
        return list(self._recent)

    def _readable(self, segment: Segment, index: int) -> list[Record]:
        """Return the readable records from `index` on; the others are dropped at the next acknowledgement."""
        known = segment.damaged
        try:
            return [record for record in segment.read() if record.index >= index]
        except OSError:
            return []
        finally:
            self.counters.damaged += segment.damaged - known

    def acknowledge(self, end: int, records: int) -> None:
        """Delete everything before `end`; `records` were acknowledged, any others could not be read and are lost."""
        if end > self._first:
            self.counters.acknowledged += records
            self.counters.dropped += max(0, end - self._first - records)
            self._move(end)

    def _move(self, first: int) -> None:
        self._first = first
        number = first.to_bytes(8, "little")
        with suppress(OSError):  # if it fails, the next process sends some messages again, marked late
            os.pwrite(self._cursor_file, number + zlib.crc32(number).to_bytes(4, "little"), 0)
        if self._segments and self._segments[0].end <= first:
            self._delete_acknowledged()

    def _delete_acknowledged(self) -> None:
        while self._segments and self._segments[0].end <= self._first and self._segments[0] is not self._active:
            self._segments.pop(0).remove()

    def begin_sync(self) -> Callable[[], None]:
        """Return a function that syncs everything stored by now to the disk; call it in a thread."""
        if self.problem:
            return lambda: None
        files = [file for segment in self._segments if (file := segment.duplicate()) is not None]
        directory = os.open(self.directory, os.O_RDONLY | os.O_CLOEXEC)
        for segment in self._segments[:-1]:
            segment.close()  # complete: not written again, so this sync is its last

        def sync() -> None:
            for file in (*files, directory):
                try:
                    os.fsync(file)
                finally:
                    os.close(file)

        return sync

    def close(self) -> None:
        """Close the files and release the lock; waiting records stay on the disk."""
        for segment in self._segments:
            segment.close()
        for file in {self._cursor_file, self._lock} - {_CLOSED}:
            os.close(file)
        self._lock = self._cursor_file = _CLOSED
