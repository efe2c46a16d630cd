"""Reads the records of an MCAP file with all its checks; what is damaged is reported, never returned.

    magic · HEADER · METADATA · (CHUNK · MESSAGE_INDEX, …), … · DATA_END · summary · FOOTER · magic

(MCAP specification: https://mcap.dev/spec.) A chunk carries a CRC-32 of its content, and from version 0.2 on DATA_END
one of everything before it. The order above is checked too: a chunk whose opcode is damaged would otherwise be skipped
as an unknown record. A file that does not end in the magic was not closed, since the daemon was killed: where its last
record is incomplete, nothing is damaged.
"""

from __future__ import annotations

import struct
import sys
import zlib
from io import BytesIO
from typing import IO, TYPE_CHECKING

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, McapRecord, MessageIndex, Metadata
from mcap.stream_reader import breakup_chunk

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # opcode, length of the content
_LONGEST = 64_000_000
"""Bytes of the longest plausible record or chunk: the daemon begins a new chunk after 1 MB at the latest."""
_LONGEST_INCOMPLETE = 4_000_000
"""Bytes that may follow the last complete record of a file that was not closed."""

_UNREADABLE = (McapError, ValueError, KeyError, struct.error, zstandard.ZstdError, MemoryError, OverflowError)
_DATA_SECTION = frozenset({Opcode.HEADER, Opcode.METADATA, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.DATA_END})


class McapScan:
    """A pass over a file. `report` is called with a text for each gap: something that is damaged, and left out."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._closed, self._size = False, 0
        self._offset = 0
        self._crc = 0
        self._unindexed = 0  # messages of the last chunk that no MESSAGE_INDEX has mentioned yet
        self._gaps = 0
        self.ended = False
        """Whether the end of the data, or damage beyond which nothing is read, has been reached."""

    def records(self, stream: IO[bytes]) -> Iterator[McapRecord]:
        """Yield metadata, and schemas, channels and messages of all valid chunks, in their order.

        Called again after the file has grown, it goes on behind the last complete record.
        """
        self._closed, self._size = closed_and_size(stream)
        for opcode, content in self._framed(stream):
            match opcode:
                case Opcode.CHUNK:
                    yield from self._chunk(content)
                case Opcode.MESSAGE_INDEX:
                    self._check_index(content)
                case Opcode.METADATA:
                    yield from self._metadata(content)
                case Opcode.DATA_END:
                    self._check_data_crc(content)
                    self.ended = True
                    return
                case _:
                    continue  # the header

    def _framed(self, stream: IO[bytes]) -> Iterator[tuple[int, bytes]]:
        """Yield opcode and content of each record of the data section; afterwards `_crc` covers it."""
        if not self._at_first_record(stream):
            return
        while len(head := stream.read(_HEAD.size)) == _HEAD.size:
            opcode, length = _HEAD.unpack(head)
            if opcode not in _DATA_SECTION or length > _LONGEST:
                self._gap(f"damaged at byte {self._offset}; the rest, {self._size - self._offset} bytes, is not read")
                self.ended = True
                return
            content = stream.read(length)
            if len(content) < length:
                break
            yield opcode, content
            self._offset += _HEAD.size + length
            self._crc = zlib.crc32(content, zlib.crc32(head, self._crc))
        if self._closed or self._size - self._offset > _LONGEST_INCOMPLETE:
            self._gap(f"damaged at byte {self._offset}; the rest, {self._size - self._offset} bytes, is not read")

    def _at_first_record(self, stream: IO[bytes]) -> bool:
        """Go to the first record that is not read yet; return whether there may be one."""
        stream.seek(self._offset)
        if self._offset:
            return not self.ended
        magic = stream.read(len(MAGIC))
        if len(magic) < len(MAGIC):  # just begun
            return False
        self._offset, self._crc = len(magic), zlib.crc32(magic)
        self.ended = magic != MAGIC
        if self.ended:
            self._gap("this is not an MCAP file, or its begin is damaged")
        return not self.ended

    def _chunk(self, content: bytes) -> list[McapRecord]:
        try:
            chunk = Chunk.read(_stream(content))
            if chunk.uncompressed_size > _LONGEST or not chunk.uncompressed_crc:  # 0 would switch the check off
                raise ValueError("implausible size or checksum")
            records = breakup_chunk(chunk, validate_crc=True)
        except _UNREADABLE:
            self._gap(f"the chunk of {len(content)} bytes at byte {self._offset} is damaged and left out")
            self._unindexed = sys.maxsize  # its number of messages is not known
            return []
        self._unindexed = sum(type(record).__name__ == "Message" for record in records)
        return records

    def _check_index(self, content: bytes) -> None:
        """Report a MESSAGE_INDEX of messages that no chunk before it holds: the chunk was not recognised."""
        try:
            self._unindexed -= len(MessageIndex.read(_stream(content)).records)
        except _UNREADABLE:
            self._unindexed = -1
        if self._unindexed < 0:
            self._gap(f"an index, or the chunk before it, is damaged at byte {self._offset}; messages may be missing")
            self._unindexed = sys.maxsize

    def _metadata(self, content: bytes) -> list[McapRecord]:
        stream = _stream(content)
        try:
            record = Metadata.read(stream)
            texts = [*record.metadata, *record.metadata.values()]
            if stream.count != len(content) or any("\0" in text for text in texts):  # a length is wrong
                raise ValueError("not a list of texts")
        except _UNREADABLE:
            self._gap(f"the metadata at byte {self._offset} are damaged")
            return []
        return [record]

    def _check_data_crc(self, content: bytes) -> None:
        try:
            expected = DataEnd.read(_stream(content)).data_section_crc
        except _UNREADABLE:
            expected = -1
        if expected not in {0, self._crc} and not self._gaps:
            self._gap("its checksum is wrong: something other than the messages is damaged, the metadata for example")

    def _gap(self, text: str) -> None:
        self._gaps += 1
        self._report(text)


def summary_channels(stream: IO[bytes]) -> dict[int, str]:
    """Return the topics by channel-ID from a closed file's summary: the chunk that defines them may be damaged."""
    topics: dict[int, str] = {}
    stream.seek(len(MAGIC))
    while len(head := stream.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        if length > _LONGEST:
            break
        content = stream.read(length)
        if opcode != Opcode.CHANNEL:
            continue
        try:
            channel = Channel.read(_stream(content))
        except _UNREADABLE:
            break
        topics[channel.id] = channel.topic
    return topics


def closed_and_size(stream: IO[bytes]) -> tuple[bool, int]:
    """Return whether a file was closed by its writer, and its size; the stream is at its begin then."""
    size = stream.seek(0, 2)
    stream.seek(max(0, size - len(MAGIC)))
    closed = stream.read(len(MAGIC)) == MAGIC and size > len(MAGIC)
    stream.seek(0)
    return closed, size


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
