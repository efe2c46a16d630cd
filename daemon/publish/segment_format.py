r"""The bytes of one file of the store: a sequence of records, each with its index and checksums.

    file    magic "regspl2\n", record, record, …
    record  marker A5 5A C3 3C · index u64 · body length u32 · topic length u16 · CRC-32 of these four · CRC-32 of the
            body, begun with the former · body (topic in UTF-8, then payload)

All numbers little endian. A damaged record is skipped: reading goes on behind it where its head is intact, otherwise at
the next intact head, and the indices tell how many records are missing. A process killed during a write, or a power
cut, leaves a last record that is short, or zeros: the file is torn. Files of version 0.1 are read as well
(`segment_format_v1`).
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from typing import NamedTuple

from regolithd.daemon.publish import segment_format_v1
from regolithd.daemon.publish.segment_record import Record, SegmentContents

MAGIC = b"regspl2\n"
_MARKER = b"\xa5\x5a\xc3\x3c"  # not valid UTF-8, so no JSON payload contains it
_HEAD = struct.Struct("<4sQIHII")
_HEAD_CHECKED = _HEAD.size - 8  # bytes before the two checksums
_TOPIC = re.compile(r"[^\0+#]+")


class _Head(NamedTuple):
    marker: bytes
    number: int
    length: int
    topic_length: int
    head_crc: int
    body_crc: int


def pack(index: int, topic: str, payload: bytes) -> bytes:
    """Return the bytes of a record."""
    name = topic.encode()
    body = name + payload
    checked = _HEAD.pack(_MARKER, index, len(body), len(name), 0, 0)[:_HEAD_CHECKED]
    head_crc = zlib.crc32(checked)
    return checked + struct.pack("<II", head_crc, zlib.crc32(body, head_crc)) + body


def unpack(data: bytes, first: int) -> SegmentContents:
    """Return what a segment's bytes hold; `first` is the index of its first record. No bytes raise an error.

    The format is recognised by the records, so that a damaged magic costs nothing.
    """
    contents = _Scan(data, first).contents()
    if not contents.records:
        older = segment_format_v1.unpack(data, first)
        if older.records or data.startswith(segment_format_v1.MAGIC):
            return older
    return contents


@dataclass(slots=True)
class _Scan:
    """Reads a segment's bytes from front to end; `expected` is the index that the next record should have."""

    data: bytes
    expected: int

    def contents(self) -> SegmentContents:
        """Return the valid records, and what is missing between and behind them."""
        records: list[Record] = []
        damaged, torn = 0, False
        offset = len(MAGIC)
        while offset < len(self.data):
            head = self._head(offset)
            if head is None:
                following = self._next_head(offset + 1)
                if following is None:
                    torn = self._is_torn(offset)
                    damaged += not torn
                    self.expected += not torn
                    break
                offset = following
                continue
            begin, offset = offset + _HEAD.size, offset + _HEAD.size + head.length
            if offset > len(self.data):
                torn, offset = True, begin - _HEAD.size
                break
            if head.number < self.expected:
                continue  # a copy of an earlier record
            record = _record(head, self.data[begin:offset])
            damaged += head.number - self.expected + (record is None)
            self.expected = head.number + 1
            if record is not None:
                records.append(record)
        return SegmentContents(records, self.expected, damaged, torn, offset if torn else len(self.data))

    def _head(self, offset: int) -> _Head | None:
        if offset + _HEAD.size > len(self.data):
            return None
        head = _Head._make(_HEAD.unpack_from(self.data, offset))
        intact = head.marker == _MARKER and zlib.crc32(self.data[offset : offset + _HEAD_CHECKED]) == head.head_crc
        return head if intact else None

    def _next_head(self, offset: int) -> int | None:
        found = self.data.find(_MARKER, offset)
        while found >= 0 and self._head(found) is None:
            found = self.data.find(_MARKER, found + 1)
        return found if found >= 0 else None

    def _is_torn(self, offset: int) -> bool:
        """Return whether the rest is the begin of a head, or zeros, as some file systems leave after a power cut."""
        return len(self.data) - offset < _HEAD.size or not self.data[offset:].strip(b"\0")


def _record(head: _Head, body: bytes) -> Record | None:
    if zlib.crc32(body, head.head_crc) != head.body_crc:
        return None
    try:
        topic = body[: head.topic_length].decode()
    except UnicodeDecodeError:
        return None
    return Record(head.number, topic, body[head.topic_length :]) if _TOPIC.fullmatch(topic) else None
