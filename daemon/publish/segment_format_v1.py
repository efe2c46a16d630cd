r"""The bytes of a file of the store as version 0.1 wrote it; only read.

    file    magic "regspl1\n", record, record, …
    record  body length u32 · CRC-32 of the body u32 · topic length u16 · body (topic in UTF-8, then payload)

The checksum does not cover the topic length. It is not used: every payload of version 0.1 is a JSON object and no topic
contains a brace, so the payload begins at the first one.
"""

from __future__ import annotations

import struct
import zlib

from regolithd.daemon.publish.segment_record import Record, SegmentContents

MAGIC = b"regspl1\n"
_HEAD = struct.Struct("<IIH")


def unpack(data: bytes, first: int) -> SegmentContents:
    """Return what a segment's bytes hold. A damaged record counts as one, and is skipped up to the next valid one."""
    records: list[Record] = []
    index, damaged, torn = first, 0, False
    offset = len(MAGIC)
    while offset < len(data):
        body = _body(data, offset)
        if body is not None:
            topic, brace, rest = body.partition(b"{")
            records.append(Record(index, topic.decode(), brace + rest))
            offset += _HEAD.size + len(body)
            index += 1
            continue
        following = next((each for each in range(offset + 1, len(data)) if _body(data, each) is not None), None)
        torn = following is None and _is_torn(data, offset)
        damaged += not torn
        index += not torn
        if following is None:
            break
        offset = following
    return SegmentContents(records, index, damaged, torn, offset if torn else len(data))


def _body(data: bytes, offset: int) -> bytes | None:
    """Return the body of the record that begins here, or None where there is no valid one."""
    if offset + _HEAD.size > len(data):
        return None
    length, checksum, _ = _HEAD.unpack_from(data, offset)
    begin = offset + _HEAD.size
    if not 0 < length <= len(data) - begin:
        return None
    body = data[begin : begin + length]
    topic = body.partition(b"{")[0]
    is_topic = 0 < len(topic) < length and topic.isascii() and not set(topic) & set(b"\0+#")
    return body if is_topic and zlib.crc32(body) == checksum else None


def _is_torn(data: bytes, offset: int) -> bool:
    """Return whether the rest is the begin of a record, or zeros, as some file systems leave after a power cut."""
    rest = data[offset:]
    return len(rest) < _HEAD.size or not rest.strip(b"\0") or _HEAD.unpack_from(rest)[0] > len(rest) - _HEAD.size
