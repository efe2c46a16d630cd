r"""One file of the store: a sequence of records, appended once and read in order.

    file    magic "regspl1\n", record, record, …
    record  body length u32 · CRC-32 of the body u32 · topic length u16 · body (topic in UTF-8, then payload)

All numbers little endian. The file's name is the index of its first record; the others follow. A process killed
during a write, or a power cut, leaves a last record that is short or fails its checksum: reading ends before it.
"""

from __future__ import annotations

import errno
import os
import struct
import zlib
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MAGIC = b"regspl1\n"
SUFFIX = ".segment"
_HEAD = struct.Struct("<IIH")


@dataclass(frozen=True, slots=True)
class Record:
    """One stored message: its topic below `<prefix>/<rover>/`, and its payload.

    `stored_ns` is when it was stored (CLOCK_MONOTONIC), or None where it was read back from disk.
    """

    index: int
    topic: str
    payload: bytes
    stored_ns: int | None = None


def pack(topic: str, payload: bytes) -> bytes:
    """Return the bytes of a record."""
    name = topic.encode()
    body = name + payload
    return _HEAD.pack(len(body), zlib.crc32(body), len(name)) + body


def unpack(data: bytes, first: int) -> Iterator[tuple[Record, int]]:
    """Yield the valid records in a segment's bytes, each with the offset of its end; stop at the first invalid one."""
    offset = len(MAGIC)
    if not data.startswith(MAGIC):
        return
    index = first
    while offset + _HEAD.size <= len(data):
        length, checksum, name_length = _HEAD.unpack_from(data, offset)
        body = data[offset + _HEAD.size : offset + _HEAD.size + length]
        if not 0 < name_length <= length or len(body) < length or zlib.crc32(body) != checksum:
            return
        offset += _HEAD.size + length
        yield Record(index, body[:name_length].decode(), body[name_length:]), offset
        index += 1


class Segment:
    """A file of the store, with its first index, number of records and size."""

    def __init__(self, path: Path, first: int, count: int, size: int) -> None:
        self.path = path
        self.first = first
        self.count = count
        self.size = size
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
        """Read a file that an earlier process left; `torn` is set where its end cannot be read."""
        segment = cls(path, int(path.stem), 0, len(MAGIC))
        data = path.read_bytes()
        for _, offset in unpack(data, segment.first):
            segment.count += 1
            segment.size = offset
        segment.torn = len(data) > segment.size
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
        """Return all its valid records."""
        return [record for record, _ in unpack(self.path.read_bytes(), self.first)]

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
