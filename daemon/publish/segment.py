"""One file of the store: records are appended once and read in order. `segment_format` describes its bytes.

The file's name is the index of its first record.
"""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from typing import TYPE_CHECKING

from regolithd.daemon.publish.segment_format import MAGIC, unpack

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.publish.segment_record import Record

SUFFIX = ".segment"


class Segment:
    """A file of the store, with its first index, number of records and size.

    `damaged` counts the records that were found to fail their checksum, `torn` says that its end could not be read.
    """

    def __init__(self, path: Path, first: int, count: int, size: int) -> None:
        self.path = path
        self.first = first
        self.count = count
        self.size = size
        self.damaged = 0
        self.torn = False
        self._file: int | None = None

    @property
    def end(self) -> int:
        """One past the index of the last record."""
        return self.first + self.count

    @classmethod
    def create(cls, directory: Path, first: int) -> Segment:
        """Create a new file whose first record will have this index."""
        path = directory / f"{first:016d}{SUFFIX}"
        segment = cls(path, first, 0, len(MAGIC))
        # An existing file of this name holds no valid record, or its index would have been counted.
        segment._file = os.open(path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC, 0o640)
        try:
            os.write(segment._file, MAGIC)
        except OSError:
            segment.remove()
            raise
        return segment

    @classmethod
    def complete(cls, path: Path, end: int) -> Segment:
        """Return the segment of a file that is known to be complete, up to the index where the next one begins."""
        first = int(path.stem)
        return cls(path, first, end - first, path.stat().st_size)

    @classmethod
    def found(cls, path: Path) -> Segment:
        """Read a file that an earlier process left, and cut off a torn end; `count` includes damaged records."""
        data = path.read_bytes()
        first = int(path.stem)
        contents = unpack(data, first)
        segment = cls(path, first, contents.end - first, contents.size)
        segment.damaged, segment.torn = contents.damaged, contents.torn
        if segment.torn:
            with suppress(OSError):  # if it stays, it is found torn again
                os.truncate(path, contents.size)
        return segment

    def append(self, record: bytes) -> None:
        """Write one record, whole or not at all."""
        assert self._file is not None  # noqa: S101  # only the newest segment is written, and it is open
        try:
            written = os.write(self._file, record)
        except OSError:
            os.ftruncate(self._file, self.size)
            raise
        if written != len(record):
            os.ftruncate(self._file, self.size)
            raise OSError(errno.ENOSPC, "the disk accepted only a part of a record", str(self.path))
        self.size += written
        self.count += 1

    def read(self) -> list[Record]:
        """Return all its valid records, and count the damaged ones."""
        contents = unpack(self.path.read_bytes(), self.first)
        self.damaged = max(self.damaged, contents.damaged)
        return [record for record in contents.records if record.index < self.end]

    def duplicate(self) -> int | None:
        """Return a duplicate file descriptor for a thread that syncs it to disk, or None where it is closed."""
        return None if self._file is None else os.dup(self._file)

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def remove(self) -> None:
        """Delete the file; if that fails, the next process finds it and skips its records as acknowledged."""
        self.close()
        with suppress(OSError):
            self.path.unlink()
