"""One MCAP file: snapshots, estimates and events as JSON, in chunks that are closed on every flush.

MCAP writes a chunk when it is full and the index at the end, so a killed process leaves a file without its last chunk
and without index. Here `flush` ends a chunk twice a second; `read_messages` reads all complete chunks, without the
index.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager
    from pathlib import Path

_CUT_OFF = (McapError, ValueError, struct.error, zstandard.ZstdError)
"""Errors of the reader where a file ends within a record."""

_SCHEMA = json.dumps({"type": "object"}).encode()


class McapFile:
    """An MCAP file being written; `stream` is closed with it."""

    def __init__(self, stream: IO[bytes], metadata: Mapping[str, str]) -> None:
        self._stream = stream
        self._writer = Writer(stream, compression=CompressionType.ZSTD)
        self._writer.start(profile="regolithd")
        self._writer.add_metadata("regolithd", dict(metadata))
        self._channels: dict[str, int] = {}

    def write(self, topic: str, time_ns: int, content: bytes, sequence: int = 0) -> None:
        """Append one JSON message."""
        channel = self._channels.get(topic)
        if channel is None:
            schema = self._writer.register_schema(topic, "jsonschema", _SCHEMA)
            channel = self._channels[topic] = self._writer.register_channel(topic, "json", schema)
        self._writer.add_message(channel, time_ns, content, time_ns, sequence)

    def flush(self) -> None:
        """Close the chunk and write everything to the kernel, so that it survives this process."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Write the index and close."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._stream.close()

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._stream.tell()


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message of a recording; `content` is parsed JSON."""

    topic: str
    time_ns: int
    content: dict[str, Any]


def open_mcap(path: Path) -> AbstractContextManager[IO[bytes]]:
    """Open a file for reading."""
    return path.open("rb")


def read_messages(
    path: Path, opening: Callable[[Path], AbstractContextManager[IO[bytes]]] = open_mcap
) -> Iterator[Recorded]:
    """Yield the messages of all complete chunks of a file, in their order."""
    topics: dict[int, str] = {}
    for record in _records(path, opening):
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            yield Recorded(topics[record.channel_id], record.log_time, json.loads(record.data))


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata that were written at the start of the recording; empty where there are none."""
    return next((record.metadata for record in _records(path, open_mcap) if isinstance(record, Metadata)), {})


def _records(path: Path, opening: Callable[[Path], AbstractContextManager[IO[bytes]]]) -> Iterator[object]:
    with opening(path) as stream:
        records = StreamReader(stream, validate_crcs=False).records
        while True:
            try:
                record = next(records)
            except (StopIteration, *_CUT_OFF):
                return  # the end of the file, or of its last complete record
            yield record
